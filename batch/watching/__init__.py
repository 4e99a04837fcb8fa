"""`met view DECK`: a deck that is watched, and a page on 127.0.0.1 that shows its run anew each time it is saved.

deck_files  the files that a deck is made of, and when one of them has changed
answers     the deck compiled, its page, and its cases run
board       what is shown now, for whoever serves it
serving     the page over HTTP, to one who has its address
frame       the page around the run: messages, which run, how far it is
following   the loop: wait, compile, show, run
"""
