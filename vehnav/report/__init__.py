"""What a run found, as one JSON document and as one page to look at."""
