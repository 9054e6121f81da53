from retraverse.images.frame import Frame as Frame
