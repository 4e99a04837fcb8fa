"""`met fit`: numbers of a deck, estimated so that its runs compute what logs measured."""
