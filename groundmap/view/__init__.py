"""What one stereo observation gives: rig, features, frames and the ground plane."""
