"""The commands of `met` that batch gives, one file each."""
