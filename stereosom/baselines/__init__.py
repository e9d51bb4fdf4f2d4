"""What the paper measures itself against or builds on: one file each, one signature.

- `point_cloud_som`: the conventional self-organizing map on a 3D point cloud. G. S. Kumar,
  P. K. Kalra, S. G. Dhande, "Curve and surface reconstruction from points: an approach based on
  self-organizing maps", Applied Soft Computing 5, 2004 (the paper's section II-A).
- `epipolar_search`: every pixel against every pixel by epipolar geometry. S. Lee, T. Poston,
  a catheter triangulated from two cameras (the paper's reference 16).
- `voxel_carving`: the voxels that all views see occupied. D. B. Camarillo, K. E. Loewke,
  C. R. Carlson, J. K. Salisbury, "Vision based 3-D shape sensing of flexible manipulators",
  IEEE ICRA 2008 (reference 4).
- `marker_arcs`: circular arcs through painted bands. M. W. Hannan, I. D. Walker, "Real-time
  shape estimation for continuum robots using vision", Robotica 23, 2005 (reference 11).
- `needle_fit`: a curve fitted in each picture, and both triangulated. R. J. Webster III et al.,
  steerable needles seen by one and by two cameras (references 24 and 25).

What they share in ordering points and in finishing a curve stands in `ordering`.
"""
