"""A session's report: records in, one self-contained HTML page out."""
