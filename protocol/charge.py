"""Who is in charge of an axis: one program at a time, by a token (object 2017h, manufacturer-specific).

Programs that do not know the object drive the axis as ever: the token only lets programs that ask for it take turns.
"""

from typing import Final

FREE: Final = 0
"""The token that is read while no program is in charge."""
UNWATCHED_MS: Final = 1000
"""Time after which a node forgets the program in charge if it monitors no heartbeat."""
