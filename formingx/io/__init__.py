"""Reading and writing of numbers, tables and files of other programs."""
