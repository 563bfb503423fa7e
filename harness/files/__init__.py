"""Files that people give (read with every complaint in its place) and files that commands write (whole or not at all)."""
