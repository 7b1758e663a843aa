"""What a plan hands on: files for instruments, layers for maps, tables, and the sheet for the field."""
