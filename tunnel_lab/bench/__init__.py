"""The bench: a page in the browser for the whole way from a logger's files to a report.

Each stage is one module. It calls the functions behind a command, or the command itself in a process of its own,
and keeps everything in files (`workspace`): a page shows what is on the disk, so that nothing is lost with it.
"""
