"""The default filter: hypotheses on the tissue as rows of one bank, and one judge."""
