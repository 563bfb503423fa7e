"""The live page: README.md here."""
