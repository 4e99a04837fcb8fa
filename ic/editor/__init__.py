"""The language server, `met lsp`: what editors ask about decks as they are written, and what MET answers."""
