"""Training of every model that ships but policies: samples, folds by building, forests and networks."""
