// Simplified Chinese: plots, the keys and the glossary.

export const texts = Object.freeze({
  "plot.keys": "方向键在各点之间移动，Enter 选中一个，+ 和 − 缩放，0 显示全部。",
  "plot.shown": "显示的量",
  "plot.in_sigma": "以标准差表示",
  "plot.in_mm": "距离（mm）",
  "plot.caption_mm": "每个采集的球与其余采集所预期位置之间的距离，单位为毫米。叉号表示未使用的采集。",
  "plot.caption_parts": "同一距离的各个分量：{parts}，单位为毫米。叉号表示未使用的采集。",
  "plot.parts_base": "基座 x, 基座 y, 基座 z",
  "plot.parts_table": "径向, 周向, 轴向",
  "plot.zoom_in": "放大",
  "plot.zoom_out": "缩小",
  "plot.zoom_all": "显示全部",
  "plot.rejected": "剔除：{reason}",
  "keys.capture": "模拟单元进行下一次采集",
  "keys.redo": "重做",
  "keys.step": "打开步骤",
  "keys.view": "显示测量或结果",
  "keys.dots": "图中：移到下一个点",
  "keys.pick": "图中：在各处选中该采集",
  "keys.exclude": "图中：排除或重新使用该采集",
  "keys.keys": "显示这些快捷键",
});
