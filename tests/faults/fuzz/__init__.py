"""Every reader of a file of a stranger, fed with anything.

A reader is a `Target` of `catalogue.py`: how an input becomes a file, which reader reads it, and
what it is fed first. The same targets run in two ways:

- `test_fuzz.py`, by Hypothesis: inputs that ever failed (`corpus/`), seeds, and changes of both;
- `scripts/faults/fuzz.py`, by atheris: millions of inputs, led by which lines they reach.

A reader passes if it reads an input or refuses it by an error of ours, without another exception,
a warning, a word on the terminal, or a file of its own.
"""
