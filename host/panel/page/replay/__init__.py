"""The page of `steptwin view`: stored runs in a browser."""
