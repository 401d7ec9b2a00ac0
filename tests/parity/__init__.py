"""Small scenes, one for each feature and value, for `scripts/parity.py`.

`catalogue.ROWS` lists them all. A row is a name and a function that changes the scene of
`stage.Stage`: adding a line to a table is all that a new feature needs.
"""
