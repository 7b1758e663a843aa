"""Where things are and where beams go.

Conventions: local frames are metres east, north (true), up; azimuths run clockwise from true north in [0, 360);
elevations are above the local horizontal at the scanner head; ranges are slant, from the head.
"""
