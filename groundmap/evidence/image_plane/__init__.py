"""The builder of 3-D maps: triangulation in the image plane, voxels by a depth buffer."""
