"""How names are written: normal form, plural, typos, phrases, nearest names; no tables."""
