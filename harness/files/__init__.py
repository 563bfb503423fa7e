"""Files that users give, read with the place of every mistake, and files that commands write, whole or not at all."""
