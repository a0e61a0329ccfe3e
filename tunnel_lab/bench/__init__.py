"""The bench: pages in the browser for all stages from a logger's files to a report.

Each stage is one module. It calls the functions behind a command, or runs the command in a separate process,
and keeps everything in files (`workspace`): a page shows the state of the disk, so closing it loses nothing.
"""
