"""The language server, `met lsp`: it answers editors' questions about decks as they are written."""
