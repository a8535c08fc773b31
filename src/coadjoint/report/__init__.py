"""Reports: the paper's section 5 run again (`report.reproduction`), summaries, and the folders that hold runs."""
