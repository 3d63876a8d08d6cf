"""The suite of hard cases: scenes with answers that a renderer must meet, the tests of its pictures, and the page of
results. See docs/lab/hard-cases.md."""
