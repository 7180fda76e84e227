"""The language server: net files in an editor."""
