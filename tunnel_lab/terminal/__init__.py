"""What commands print: tables, numbers, progress."""
