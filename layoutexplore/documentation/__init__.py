"""The documentation: Markdown pages, runnable examples, and the site that is built from them."""
