"""A scene as a mechanism of links, numbered, in the arrays that the kernels take."""
