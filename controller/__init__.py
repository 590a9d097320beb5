"""The board's firmware in integers: frames, inputs and time in; frames, pulse edges and pin changes out."""
