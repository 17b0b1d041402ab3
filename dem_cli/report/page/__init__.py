"""The page of `dem report --html`: tables, pictures and a player of the frames in one file that fetches nothing."""
