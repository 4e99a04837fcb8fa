"""The wire to a bed (docs/protocol.md): frames, and the messages in them."""
