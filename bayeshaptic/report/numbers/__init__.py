"""What sentences, tables, figures and files of a report read: one source for every number."""
