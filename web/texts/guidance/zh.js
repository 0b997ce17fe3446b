// 中文。单元可达到的精度、某点的误差预算、规划的位姿。

export const texts = {
  "guidance.number": "请输入数字。",

  "plan.title": "规划单元", "plan.how": "在购买或安装之前可以达到什么：用哪种球、需要多少次采集、放在哪里。",
  "plan.scanner": "扫描仪", "plan.near_mm": "视场起点，mm", "plan.far_mm": "视场终点，mm", "plan.near_width_mm": "起点处宽度，mm", "plan.far_width_mm": "终点处宽度，mm",
  "plan.point_sigma_mm": "单点噪声，mm", "plan.pitch_mm": "点间距，mm", "plan.mounting_mm": "法兰到扫描仪，mm",
  "plan.cell": "机械臂、球和目标", "plan.arm": "机械臂", "plan.arm_ordinary": "普通", "plan.arm_calibrated": "运动学经过测量", "plan.arm_nominal": "大型，出厂状态",
  "plan.sphere_class": "球的质量", "plan.sphere_certified": "有校准证书", "plan.sphere_bearing": "轴承钢球", "plan.sphere_coated": "哑光涂层", "plan.sphere_turned": "车削或打印",
  "plan.sphere_diameter_mm": "球的直径，mm（留空：尝试常用值）", "plan.wanted_mm": "工件处期望的 ±，mm",
  "plan.table": "带转台", "plan.table_radius_mm": "工件离轴线最远，mm", "plan.table_height_mm": "工件高度，mm", "plan.table_angle_sigma_deg": "角度的标准差，°",
  "plan.go": "规划", "plan.wait": "正在规划……", "plan.seen": "让扫描仪在 {distance} mm 处看到球，激光线偏离球心 {offset} mm。", "plan.limited": "更多采集无助于：{by}。",
  "plan.sphere": "球", "plan.captures": "采集次数", "plan.then": "之后的 ±", "plan.off_axis": "离轴线", "plan.heights": "高度数", "plan.angles": "每个高度的角度数",

  "budget.title": "误差预算", "budget.how": "各来源在所选点处对测量点的影响：在转台坐标系中（角度为零）；没有转台时为扫描仪看到它的位置。",
  "budget.axis": "{axis}，mm", "budget.go": "显示", "budget.one_scan": "单次扫描 {one}，无论平均多少次 {many}（k = 2，最不利方向）。",
  "budget.part": "来源", "budget.rms": "标准差", "budget.worst": "最不利方向", "budget.kind": "多次扫描", "budget.shared": "每次扫描相同", "budget.averages": "可平均消除",
  "budget.part_tool": "法兰上的扫描仪（TCP）", "budget.part_scanner": "扫描仪自身误差", "budget.part_table": "转台", "budget.part_arm": "机械臂自身散布", "budget.part_arm_alike": "机械臂，相近位姿相同（部分抵消）", "budget.part_angle": "转台角度", "budget.part_points": "单点噪声", "budget.part_camera": "相机", "budget.part_plane": "光平面",
  "budget.within": "95 % 的误差在 ± {within} 之内（x、y、z）。", "budget.offset": "已知偏差 {offset}（x、y、z），因为已查明的扫描仪误差仍留在其文件中。",
  "budget.cancel": "它们一同求得：误差相互抵消 {amount}。", "budget.add_up": "它们一同求得：误差相互叠加 {amount}。", "budget.stale": "此结果已过期：请重新求解。",
  "budget.height": "转台上方高度", "budget.picture": "转台上方的不确定度，从 {least} 到 {most}", "budget.pick": "单击选择一个点。浅色为 {least}，深色为 {most}。",

  "planned.title": "规划的位姿", "planned.how": "共同使工件处不确定度最小的位姿，最有帮助的在前。",
  "planned.step": "用于", "planned.step_tcp": "TCP", "planned.step_turntable": "转台", "planned.step_verify": "验证",
  "planned.pose": "法兰在基座中（{convention}）", "planned.brand": "控制器", "planned.save": "保存为程序", "planned.saved": "{name} 已保存。",
  "planned.safety": "程序以法兰为准，从远处缓慢接近，每次移动前停下，直到操作员启动。请使用手动模式。",

  "arm.unknown": "未知", "arm.urdf": "来自 URDF ……", "arm.taken": "{source}：{count} 个关节",
  "certificate.taken": "已采用证书 {number} 的 {name}。", "certificate.several": "证书 {number} 含多个直径；已采用 {name}。请确认是否正确。",
};
