"""What is in a file: a look at its columns, before anything is read as a recording."""
