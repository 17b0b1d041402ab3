"""What a result file says: summary, text, CSV and pictures. Reads result files only, never an engine."""
