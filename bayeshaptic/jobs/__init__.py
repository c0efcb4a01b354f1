"""From files to reports: one recording or study, or many, and where the work runs."""
