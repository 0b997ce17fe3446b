"""The workbench: command line, REST service, store, jobs and 3-D scenes."""
