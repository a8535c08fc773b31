"""The command line: run files and commands; `cli.main` is the entry."""
