! reachmap motions of example
! map abababababababababababababababababababababababababababababababab
! cell cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd
! base robot_base; TCP in tool0, 4x4 by rows [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.25, 0, 0, 0, 1]
! joints joint_1, joint_2, joint_3, joint_4, joint_5, joint_6: signs and zeros of the URDF
! joint motions with an exact stop at every point (blend radius 0), as verified; do not blend
! each starts at its first point, the scan configuration; the way there was not verified
MODULE reachmap_motions
  PROC to_grasp_0_3_7_12()
    MoveAbsJ [[0.0000000, -85.9436693, 71.6197244, 14.3239449, -85.9436693, 7.1619724], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
    MoveAbsJ [[3.5809862, -82.3626831, 75.2007106, 17.9049311, -82.3626831, 10.7429587], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
    MoveAbsJ [[7.1619724, -82.3626831, 71.6197244, 17.9049311, -85.9436693, 7.1619724], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
    MoveAbsJ [[7.1619724, -81.9150598, 71.1721011, 17.9049311, -85.9436693, 7.1619724], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
  ENDPROC
  PROC to_grasp_1_0_0_2()
    MoveAbsJ [[0.0000000, -85.9436693, 71.6197244, 14.3239449, -85.9436693, 7.1619724], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
    MoveAbsJ [[3.5809862, -82.3626831, 75.2007106, 17.9049311, -82.3626831, 10.7429587], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]], v1000, fine, tool0;
  ENDPROC
ENDMODULE
