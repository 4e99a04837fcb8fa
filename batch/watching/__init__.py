"""`met view DECK`: a deck that is watched, and a page on 127.0.0.1 that shows its run anew each time it is saved.

answers     the deck compiled, its page, and its cases run
board       what is shown now, for whoever serves it
door        who connects to it waits here until the request shows that the address is known
serving     the page over HTTP, to one who has its address, with a frame around the run: messages, how far it is
following   the deck's files, and when one of them has changed; the loop: wait, compile, show, run
"""
