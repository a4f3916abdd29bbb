"""Reports on recordings: contacts, palpation map, verdict in words, self-contained pages.

Modules: contacts (one row per contact), contact_file (CSV and parquet), palpation_map
(Gaussian-process regression over where it was felt), map_file (PNG, CSV, PLY), verdict (what a
recording says, in sentences), rows (a run in the form of the live page), page (one HTML file),
comparison and comparison_page (several runs side by side).
"""
