// Keeps the scene legible whatever the camera does: labels never stand on each other, axes keep their size on the screen,
// the legend has a place of its own, and a page around the scene says which layers tell its story.
// It works on what viser's client shows of itself for tests (its version is pinned; tests/web/test_scene_story.py).
(() => {
  const GLYPH_PX = 34, PICKED = 1.3;
  const FONT_PX = 15; // a label of scale 1 as viser draws it, on a window 600 px high
  const EVERY_MS = 120;
  const LONGEST_REASON = 64;
  const LABEL_BACK = "vec4(1.0, 1.0, 1.0, 0.85 *"; // in the shader of labels' grounds
  const IN_THE_DARK = [[LABEL_BACK, "vec4(0.11, 0.12, 0.13, 0.85 *"], ["vec4(0.0, 0.0, 0.0, a)", "vec4(0.9, 0.91, 0.93, a)"]];
  const LIGHT_BLUE = [0.13, 0.36, 1], LIGHT_RED = [0.9, 0.13, 0.1]; // linear
  const POINT_SIZE = "gl_PointSize = (scale / -world_pos.z)"; // in the shader of points
  const EVEN_SIZE = "float middle = scale / max(-modelViewMatrix[3].z, 1e-6); gl_PointSize = clamp(scale / -world_pos.z, 0.8 * middle, 1.25 * middle)";
  const state = { layers: null, labels: [], say: null, translated: new WeakMap(), english: new Map(), hovered: "", camera: "", labelGroup: null, asMade: new WeakMap() };
  const box = document.createElement("canvas").getContext("2d");

  /** What stands first where two labels want one place: what is picked, what comes next, then what was rejected last. */
  const rank = (name, text, scale) => (scale > 1.25 ? 0 : name.startsWith("/ghost") ? 1 : name.startsWith("/turned") ? 2 : text.startsWith("✕") ? 4 : 3);

  const tree = () => window.__viserSceneTree?.getState();

  function shown(name, nodes) {
    const parts = name.split("/");
    for (let length = 2; length <= parts.length; length++) {
      const node = nodes[parts.slice(0, length).join("/")];
      if (node && !(node.overrideVisibility ?? node.visibility ?? true)) return false;
    }
    return true;
  }

  function showLayers(nodes) {
    if (!state.layers) return;
    for (const [name, node] of Object.entries(nodes)) {
      if (!/^\/[a-z]+$/.test(name)) continue;
      const wanted = state.layers[name.slice(1)];
      if (wanted !== undefined && (node.overrideVisibility ?? node.visibility ?? true) !== wanted) node.overrideVisibility = wanted;
    }
  }

  /** Where a node is on the screen, and how many pixels a metre has there. */
  function place(name, mutable, size) {
    const parent = mutable.nodeRefFromName[name.slice(0, name.lastIndexOf("/"))];
    const pose = mutable.nodePoseData?.[name];
    const ref = mutable.nodeRefFromName[name] ?? parent;
    if (!ref) return null;
    const at = ref.position.clone();
    if (pose && parent) at.set(...pose.position).applyMatrix4(parent.matrixWorld);
    else ref.getWorldPosition(at);
    const seen = at.clone().applyMatrix4(mutable.camera.matrixWorldInverse);
    if (seen.z >= 0) return null;
    at.project(mutable.camera);
    const perMetre = size.height / (2 * Math.tan((mutable.camera.fov * Math.PI) / 360) * -seen.z);
    return { x: ((at.x + 1) / 2) * size.width, y: ((1 - at.y) / 2) * size.height, perMetre };
  }

  function rectOf(at, text, scale, anchor, height) {
    const font = FONT_PX * scale * Math.max(height / 600, 0.6);
    box.font = `${font}px system-ui, sans-serif`;
    const width = box.measureText(text).width + font * 0.9, tall = font * 1.6;
    const [vertical, horizontal = "center"] = anchor.split("-");
    const left = at.x - (horizontal === "left" ? 0 : horizontal === "right" ? width : width / 2);
    const top = at.y - (vertical === "top" ? 0 : vertical === "bottom" ? tall : tall / 2);
    return { left, top, right: left + width, bottom: top + tall };
  }

  const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;

  /** A reason's first sentence without what stands in brackets; of a long one the clauses that a label has room for. */
  function shortened(reason) {
    const [sentence] = reason.replace(/\s*[(（][^)）]*[)）]/g, "").split(/[.](?=\s|$)|。/u);
    if (sentence.length <= LONGEST_REASON) return sentence;
    const room = sentence.slice(0, LONGEST_REASON);
    return /^(.{12,})[,;:，；：]/su.exec(room)?.[1] ?? `${room.slice(0, -1).trimEnd()}…`;
  }

  /** A label's parts, `✕ p03 · reason`, each in the language of the page around the scene. */
  function labelWords(english) {
    const say = state.say ?? ((text) => text);
    return english.split(" · ").map((part, place) => (place && english.startsWith("✕") ? shortened(say(part)) : say(part))).join(" · ");
  }

  /**
   * The server tells all who look the same, in English. What a page makes of it, it tells its own client as the server
   * would: the nodes' own properties are the client's.
   */
  function sayLabels(nodes, mutable) {
    for (const [name, node] of Object.entries(nodes)) {
      if (node.message?.type !== "LabelMessage") continue;
      const { text } = node.message.props, before = state.english.get(name);
      if (before?.words === text && before.say === state.say) continue;
      const english = before?.words === text ? before.english : text;
      const words = labelWords(english);
      state.english.set(name, { english, words, say: state.say });
      if (words !== text) mutable.messageQueue.push({ type: "SceneNodeUpdateMessage", name, owner: node.message.owner, updates: { text: words } });
    }
    if (mutable.messageQueue.length) mutable.requestRender?.();
  }

  function showLabels(nodes, mutable, size) {
    const wanted = [];
    for (const [name, node] of Object.entries(nodes)) {
      if (node.message?.type !== "LabelMessage") continue;
      const { text, font_screen_scale: scale, anchor } = node.message.props;
      const at = shown(name, nodes) ? place(name, mutable, size) : null;
      if (!at || at.x < 0 || at.y < 0 || at.x > size.width || at.y > size.height) {
        node.effectiveVisibility = false;
        continue;
      }
      wanted.push({ name, node, text, rank: rank(name, text, scale), rect: rectOf(at, text, scale, anchor, size.height) });
    }
    wanted.sort((a, b) => a.rank - b.rank || (a.name < b.name ? -1 : 1));
    const placed = [];
    for (const label of wanted) {
      const free = placed.every((other) => apart(label.rect, other.rect));
      label.node.effectiveVisibility = free;
      if (free) placed.push(label);
    }
    state.labels = placed.map(({ name, text, rect }) => ({ name, text, ...rect }));
    state.hidden = wanted.filter(({ node }) => !node.effectiveVisibility);
  }

  /** Axes of captures and of the next pose are as large on the screen from near as from afar. */
  function sizeGlyphs(nodes, mutable, size) {
    for (const [name, node] of Object.entries(nodes)) {
      if (node.message?.type !== "FrameMessage" || !node.message.props.show_axes || !/^\/(frames|ghost|trial)\//.test(name)) continue;
      const ref = mutable.nodeRefFromName[name];
      const length_m = (node.message.props.axes_length ?? 0) * (typeof node.message.props.scale === "number" ? node.message.props.scale : 1);
      const at = ref && length_m > 0 ? place(name, mutable, size) : null;
      if (!at) continue;
      const wish = GLYPH_PX * (length_m > 0.05 ? PICKED : length_m < 0.03 ? 0.7 : 1);
      const factor = wish / (length_m * at.perMetre);
      if (Math.abs(ref.scale.x / factor - 1) > 0.03) ref.scale.setScalar(factor);
    }
  }

  /**
   * Labels are black on white and axes deep blue as viser draws them, whatever the theme: in the dark both are light.
   * Glyphs, axes and themes come by and by; whether anything is another colour now.
   */
  function paint(nodes, mutable) {
    const isDark = document.documentElement.classList.contains("dark");
    if (!state.labelGroup?.parent) {
      mutable.scene?.traverse((one) => { if (one.material?.fragmentShader?.includes(LABEL_BACK)) state.labelGroup = one.parent; });
      const group = state.labelGroup, add = group?.add;
      // Letters come with the first frame that has them: painted after it they would flash.
      if (group && !Object.hasOwn(group, "add")) group.add = (...parts) => { add.apply(group, parts); paintLabels(); return group; };
    }
    let changed = paintLabels();
    for (const [name, node] of Object.entries(nodes)) {
      if (!/^(Frame|BatchedAxes)Message$/.test(node.message?.type)) continue;
      mutable.nodeRefFromName[name]?.traverse(({ geometry, instanceColor }) => { changed = paintAxes(instanceColor ?? geometry?.attributes.color, isDark) || changed; });
    }
    return changed;
  }

  function paintLabels() {
    const isDark = document.documentElement.classList.contains("dark");
    let changed = false;
    for (const { material } of state.labelGroup?.children ?? []) {
      if (Boolean(material.userData.isDark) === isDark) continue;
      for (const [light, dark] of IN_THE_DARK) material.fragmentShader = material.fragmentShader.replace(isDark ? light : dark, isDark ? dark : light);
      material.userData.isDark = isDark;
      changed = material.needsUpdate = true;
    }
    return changed;
  }

  function paintAxes(colors, isDark) {
    if (!colors || state.asMade.has(colors) === isDark) return false;
    if (!isDark) colors.array.set(state.asMade.get(colors));
    else state.asMade.set(colors, colors.array.slice());
    for (let index = 0; isDark && index < colors.count; index++) {
      const [red, green, blue] = [colors.getX(index), colors.getY(index), colors.getZ(index)];
      if (blue > 0.5 && red + green < 0.01) colors.setXYZ(index, ...LIGHT_BLUE);
      if (red > 0.5 && blue + green < 0.01) colors.setXYZ(index, ...LIGHT_RED);
    }
    if (!isDark) state.asMade.delete(colors);
    return (colors.needsUpdate = true);
  }

  /** All points of a cloud are about as large on the screen as those at its middle: strays near the camera are no balls. */
  function evenPoints(nodes, mutable) {
    let changed = false;
    for (const [name, node] of Object.entries(nodes)) {
      if (node.message?.type !== "PointCloudMessage") continue;
      mutable.nodeRefFromName[name]?.traverse(({ material }) => {
        if (!material?.vertexShader?.includes(POINT_SIZE)) return;
        material.vertexShader = material.vertexShader.replace(POINT_SIZE, EVEN_SIZE);
        changed = material.needsUpdate = true;
      });
    }
    return changed;
  }

  /** The legend stands below the picture: it covers nothing. */
  function makeRoom() {
    const legend = document.getElementById("scancell-legend"), root = document.getElementById("root");
    if (!legend || !root) return;
    const height = `${window.innerHeight - legend.offsetHeight}px`;
    if (root.style.height !== height) root.style.height = height;
  }

  function arrange() {
    makeRoom();
    const mutable = window.__viserMutable, nodes = tree();
    // Axes alone would tell nothing: until the first of the scene is there, the page around it says that it is loading.
    window.frameElement?.classList.toggle("waiting", !nodes?.["/ambient-light"]);
    if (!mutable?.camera || !nodes || document.hidden) return;
    const canvas = mutable.canvas ?? document.querySelector("canvas");
    if (!canvas) return;
    showLayers(nodes);
    const painted = [paint(nodes, mutable), evenPoints(nodes, mutable)].includes(true);
    const size = { width: canvas.clientWidth, height: canvas.clientHeight };
    sizeGlyphs(nodes, mutable, size);
    sayLabels(nodes, mutable);
    showLabels(nodes, mutable, size);
    const now = `${mutable.camera.matrixWorld.elements.map((v) => v.toFixed(5)).join()} ${state.labels.map(({ name }) => name).join()} ${JSON.stringify(state.layers)} ${size.width}x${size.height}`;
    if (painted || now !== state.camera) mutable.requestRender?.();
    state.camera = now;
  }

  /** Where labels had no room, the nearest one is told where the pointer rests. */
  function hover(event) {
    const tip = document.getElementById("scancell-tip");
    if (!tip) return;
    const near = (state.hidden ?? []).map((label) => ({ label, far: Math.hypot((label.rect.left + label.rect.right) / 2 - event.clientX, label.rect.bottom - event.clientY) })).sort((a, b) => a.far - b.far)[0];
    tip.textContent = near && near.far < 22 ? near.label.text : "";
    tip.style.left = `${Math.min(event.clientX + 12, window.innerWidth - 160)}px`;
    tip.style.top = `${event.clientY + 14}px`;
  }

  /** The legend in the language of the page around the scene: what it says is told in English, and anew with each change. */
  function translate(legend) {
    const texts = document.createTreeWalker(legend, NodeFilter.SHOW_TEXT);
    for (let text = texts.nextNode(); text; text = texts.nextNode()) {
      const before = state.translated.get(text), told = before?.shown === text.data ? before.told : text.data;
      const bare = told.trim();
      if (!bare) continue;
      const shown = told.replace(bare, () => state.say(bare));
      state.translated.set(text, { told, shown });
      if (shown !== text.data) text.data = shown;
    }
  }

  function speak(say) {
    const legend = document.getElementById("scancell-legend");
    if (!legend) return;
    const first = !state.say;
    state.say = (text) => say(text); // another one each time: by then more may be known
    translate(legend);
    if (first) new MutationObserver(() => translate(legend)).observe(legend, { childList: true });
  }

  // The page around the scene has the same origin, and calls this.
  window.scancellScene = {
    /** @param {Record<string, boolean>} layers */
    show(layers) { state.layers = layers; arrange(); },
    labels: () => state.labels,
    layers: () => state.layers,
    /** @param {(text: string) => string} say what the server says in English, in another language */
    speak,
  };
  window.addEventListener("pointermove", hover);
  window.setInterval(arrange, EVERY_MS);
  arrange();
})();
