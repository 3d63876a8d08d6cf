"""The suite of hard cases: scenes with an answer that a renderer must meet, their judge and its page. See
docs/lab/hard-cases.md."""
