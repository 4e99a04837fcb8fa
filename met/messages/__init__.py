"""Messages to people and editors: diagnostics are rendered, texts made visible, units proposed."""
