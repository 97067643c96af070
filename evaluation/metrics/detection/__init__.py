"""How well boxes in space were detected: KITTI's, the thesis' and nuScenes' measures."""
