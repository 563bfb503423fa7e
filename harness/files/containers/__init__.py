"""Readers of binary files, one format a file, each on the library of its field; imported only when such a file is read."""
