"""Report pages: Markdown and self-contained HTML."""
