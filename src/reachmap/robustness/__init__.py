"""Which grasps stay reachable when bin, camera or tool are off."""
