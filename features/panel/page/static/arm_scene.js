// The 3D view of an arm: polylines as tubes, in mm, z up. Draws only when something has changed, since a machine without
// a graphics card draws with its processor.
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "nicegui-scene";

const UP = new THREE.Vector3(0, 1, 0); // a cylinder's own axis

// A set of tubes between points, as one instanced mesh of cylinders and one of spheres at the points. A ring: when it is
// full, the newest piece takes the oldest one's place.
// With an `order`, tubes are drawn in this order after all others, and can be guessed behind what hides them.
class Tubes {
  constructor(radius, { color, opacity = 1, balls = true, capacity = 64, order = 0 }) {
    const solid = opacity === 1 && !order;
    this.color = color;
    this.material = new THREE.MeshLambertMaterial({ transparent: !solid, opacity, depthWrite: solid });
    this.faint = order ? new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.3, depthTest: false }) : null;
    this.order = order;
    this.radius = radius;
    this.group = new THREE.Group();
    this.balls = balls;
    this.allocate(capacity);
  }

  allocate(capacity) {
    this.dispose();
    this.capacity = capacity;
    const tube = new THREE.CylinderGeometry(1, 1, 1, this.balls ? 16 : 5, 1, !this.balls);
    this.tubes = new THREE.InstancedMesh(tube, this.material, capacity);
    this.joints = new THREE.InstancedMesh(new THREE.SphereGeometry(1, 16, 10), this.material, this.balls ? capacity : 1);
    this.meshes = [this.tubes, this.joints];
    if (this.faint) {
      this.through = new THREE.InstancedMesh(tube, this.faint, capacity);
      this.through.instanceMatrix = this.tubes.instanceMatrix;
      this.meshes.push(this.through);
    }
    for (const mesh of this.meshes) {
      mesh.frustumCulled = false;
      mesh.renderOrder = this.order;
      this.group.add(mesh);
    }
    this.clear();
  }

  paint(color) {
    this.material.color = color;
    if (this.faint) this.faint.color = color;
  }

  // Change the thickness of all pieces; tubes without balls only.
  thicken(radius) {
    const part = radius / this.radius;
    const numbers = this.tubes.instanceMatrix.array;
    for (let i = 0; i < 16 * this.tubes.count; i += 16) {
      for (const k of [0, 1, 2, 8, 9, 10]) numbers[i + k] *= part;
    }
    this.radius = radius;
    this.tubes.instanceMatrix.needsUpdate = true;
  }

  dispose() {
    for (const mesh of this.meshes ?? []) {
      this.group.remove(mesh);
      mesh.geometry.dispose();
      mesh.dispose();
    }
  }

  clear() {
    this.next = 0;
    this.last = null;
    this.box = new THREE.Box3();
    for (const mesh of this.meshes) mesh.count = 0;
  }

  // Show polylines, each a flat list x, y, z, x, y, z, ...
  set(lines) {
    const points = lines.reduce((sum, line) => sum + line.length / 3, 0);
    if (points > this.capacity) this.allocate(2 * points);
    this.clear();
    for (const line of lines) {
      this.last = null;
      for (let i = 0; i < line.length; i += 3) this.add(line[i], line[i + 1], line[i + 2]);
    }
  }

  add(x, y, z) {
    const end = new THREE.Vector3(x, y, z);
    const at = this.next % this.capacity;
    if (this.last) {
      const along = end.clone().sub(this.last);
      const length = along.length();
      const turn = new THREE.Quaternion().setFromUnitVectors(UP, length ? along.clone().divideScalar(length) : UP);
      const middle = this.last.clone().addScaledVector(along, 0.5);
      const scale = new THREE.Vector3(this.radius, Math.max(length, 1e-6), this.radius);
      this.tubes.setMatrixAt(at, new THREE.Matrix4().compose(middle, turn, scale));
      this.next += 1;
      this.tubes.count = Math.min(this.next, this.capacity);
      if (this.through) this.through.count = this.tubes.count;
      this.tubes.instanceMatrix.needsUpdate = true;
    }
    if (this.balls) {
      const ball = new THREE.Matrix4().makeScale(1.25 * this.radius, 1.25 * this.radius, 1.25 * this.radius);
      this.joints.setMatrixAt(this.joints.count, ball.setPosition(end));
      this.joints.count = Math.min(this.joints.count + 1, this.capacity - 1);
      this.joints.instanceMatrix.needsUpdate = true;
    }
    this.last = end;
    this.box.expandByPoint(end);
  }
}

// Thickness of what is drawn of a machine, as parts of its size; bodies have balls at their ends.
const BODIES = { guide: 1 / 75, slide: 1 / 26, link: 1 / 36, tool: 1 / 80 };
const LINES = { axis: 1 / 190, x: 1 / 130, y: 1 / 130, z: 1 / 130 };
const MARKS = { axes: ["axis"], frames: ["x", "y", "z"] };
const HEAD = { radius: 1 / 40, length: 1 / 14 }; // of the arrow that shows where the tool points

// An arm in pieces: guides thin, slides and links thick, the tool thin and in the colour of its trace, then an arrow where
// it points. With marks also the axes of its joints, and frames, which are hidden at first.
class Arm {
  constructor(size, color, toolColor, opacity, marks) {
    const tints = { guide: "--guide", tool: toolColor };
    const piece = (role, part, tint, balls) => [role, new Tubes(size * part, { color: tint, opacity, balls })];
    const bodies = Object.entries(BODIES).map(([role, part]) => piece(role, part, tints[role] ?? color, true));
    const lines = marks ? Object.entries(LINES).map(([role, part]) => piece(role, part, `--mark-${role}`, false)) : [];
    this.pieces = Object.fromEntries([...bodies, piece("hand", 1 / 110, toolColor, false), ...lines]);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(HEAD.radius * size, HEAD.length * size, 20), this.pieces.hand.material);
    this.head.visible = false;
    this.pieces.hand.group.add(this.head);
    this.size = size;
    if (marks) this.showMarks("frames", false);
  }

  set(lines, roles) {
    for (const [role, tubes] of Object.entries(this.pieces)) tubes.set(lines.filter((_, i) => roles[i] === role));
    const hand = lines[roles.indexOf("hand")];
    this.head.visible = Boolean(hand);
    if (!hand) return;
    const [from, to] = [0, 3].map((at) => new THREE.Vector3().fromArray(hand, at));
    const way = to.clone().sub(from).normalize();
    this.head.quaternion.setFromUnitVectors(UP, way);
    this.head.position.copy(to).addScaledVector(way, (-HEAD.length * this.size) / 2);
  }

  showMarks(name, on) {
    for (const role of MARKS[name]) this.pieces[role].group.visible = on;
  }

  // Rails and masts may be many times as long as the arm: what a camera holds is without those.
  get box() {
    const { guide, slide, link, tool } = this.pieces;
    const all = [slide, link, tool].reduce((box, tubes) => box.union(tubes.box), new THREE.Box3());
    const length = (box) => box.getSize(new THREE.Vector3()).length();
    return length(guide.box) <= length(all) ? all.union(guide.box) : all;
  }
}

const SLOW_MS = 40;
const COARSE = 0.5; // resolution of a slow machine while a jog button is held: a quarter of the work
const HELD = 6; // ... and how much longer it then leaves off drawing than it draws
const CAMERA_KEY = "steptwin-camera"; // where this tab's camera is, for the next load of the page
const MARGIN = 1.2; // how much more than what it holds a camera sees
const LINES_PER_VIEW = 420; // thickness of lines: this part of the camera's distance
const LOOSE = 1.5; // a camera that sees so many times what is shown comes closer
const LOOSE_MS = 3000;
const isDark = () => document.body.classList.contains("body--dark");
const VIEWS = { top: [0, -0.001, 1], front: [0, -1, 0.12], side: [1, 0, 0.12], iso: [0.75, -1, 0.7] };

export default {
  template: `
    <div class="arm-scene" role="img" :aria-label="label">
      <canvas></canvas>
      <div class="arm-scene-names" aria-hidden="true"></div>
      <div class="arm-scene-scale" v-if="!failed && !hidden">grid {{ step() }} mm</div>
      <div class="arm-scene-off" v-if="failed">This browser has no 3D here.</div>
      <div class="arm-scene-off" v-else-if="hidden">The 3D view is switched off.</div>
    </div>`,
  props: { label: String, roles: Array, names: Array, size: Number, span: Number, hold: Array, boxes: Array },
  data: () => ({ failed: false, hidden: false }),

  mounted() {
    const canvas = this.$el.querySelector("canvas");
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "low-power" });
    } catch {
      this.failed = true;
      return;
    }
    this.renderer.debug.checkShaderErrors = false; // the check would wait for the compiler, seconds without a graphics card
    this.on = true;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, this.span / 100, this.span * 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.turned());
    this.controls.addEventListener("start", () => (this.follows = false));
    this.controls.addEventListener("end", () => this.remember());
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.6, -1, 1.8);
    this.scene.add(sun);
    const thin = this.span / LINES_PER_VIEW;
    this.lines = {
      plan: new Tubes(1.5 * thin, { color: "--plan", balls: false, capacity: 1024, order: 1 }),
      trace: new Tubes(0.8 * thin, { color: "--trace", balls: false, capacity: 4096, order: 2 }),
    };
    this.thin = thin;
    this.arms = {
      arm: new Arm(this.size, "--arm", "--trace", 1, true),
      ghost: new Arm(this.size, "--ghost", "--ghost", 0.4, false),
      other: new Arm(this.size, "--other", "--other", 0.55, false),
    };
    this.tubes = [...Object.values(this.lines), ...Object.values(this.arms).flatMap((arm) => Object.values(arm.pieces))];
    for (const tubes of this.tubes) this.scene.add(tubes.group);
    this.furniture = new THREE.Group();
    this.scene.add(this.furniture);
    this.setBoxes(this.boxes || []);
    this.makeNames();
    this.recolor();
    this.themes = new MutationObserver(() => this.dark === isDark() || this.recolor());
    this.themes.observe(document.body, { attributeFilter: ["class"] });
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.$el);
    this.held = new THREE.Box3();
    this.look("iso");
    this.recall();
    this.$el.armScene = this;
  },

  beforeUnmount() {
    this.stayAway();
    this.themes?.disconnect();
    this.sizes?.disconnect();
    this.controls?.dispose();
    this.renderer?.dispose();
  },

  methods: {
    // Show an arm's parts, or a line; each part is a flat list of coordinates.
    show(name, lines) {
      if (this.failed) return;
      if (this.arms[name]) this.arms[name].set(lines, this.roles);
      else this.lines[name].set(lines);
      if (name === "arm" && lines.length) this.placeNames(lines);
      if (name === "plan" && lines.some((line) => line.length)) this.comeCloser();
      else this.holdAll();
      this.draw();
    },

    // Lengthen the trace to a point, unless that is less than a pixel or so from its end.
    trace(x, y, z) {
      if (this.failed) return;
      const { last } = this.lines.trace;
      if (last && last.distanceTo(new THREE.Vector3(x, y, z)) < this.span / 2000) return;
      this.lines.trace.add(x, y, z);
      this.holdAll();
      this.draw();
    },

    clear(name) {
      this.show(name, []);
    },

    // Boxes are [x, y, z, width, depth, height], with x, y, z in their middle.
    setBoxes(boxes) {
      this.furniture.clear();
      for (const [x, y, z, width, depth, height] of boxes) {
        const geometry = new THREE.BoxGeometry(width, depth, height);
        const material = new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.16, depthWrite: false });
        const box = new THREE.Mesh(geometry, material);
        const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial());
        for (const part of [box, edges]) {
          part.position.set(x, y, z);
          this.furniture.add(part);
        }
      }
    },

    // Move every box by [x, y, z] from where it stands.
    moveBoxes(shifts) {
      if (this.failed) return;
      shifts.forEach((shift, i) => {
        for (const part of this.furniture.children.slice(2 * i, 2 * i + 2)) {
          part.position.set(...this.boxes[i].slice(0, 3).map((at, k) => at + shift[k]));
        }
      });
      this.draw();
    },

    // --- the names of joints and axes, as text over the picture

    makeNames() {
      this.written = new CSS2DRenderer({ element: this.$el.querySelector(".arm-scene-names") });
      this.joints = this.names.map(({ text, part, point }) => ({ name: this.write(text, "joint"), part, point }));
      const step = this.step();
      this.axes = new THREE.Group();
      this.scene.add(this.axes);
      ["x", "y", "z"].forEach((name, i) => {
        const end = new THREE.Vector3().setComponent(i, 2 * step);
        const line = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), end]);
        this.axes.add(new THREE.Line(line, new THREE.LineBasicMaterial()));
        this.write(name, "axis").position.copy(end);
      });
    },

    write(text, kind) {
      const element = document.createElement("span");
      element.className = `arm-scene-name ${kind}`;
      element.textContent = text;
      const name = new CSS2DObject(element);
      this.scene.add(name);
      return name;
    },

    placeNames(lines) {
      for (const { name, part, point } of this.joints) name.position.fromArray(lines[part], 3 * point);
    },

    // --- the camera

    // The arms and the planned path, or the lines alone; empty without anything. An old trace may lead far away.
    seen(linesOnly = false) {
      const shown = linesOnly ? Object.values(this.lines) : [this.lines.plan, ...Object.values(this.arms)];
      const all = shown.reduce((box, each) => box.union(each.box), new THREE.Box3());
      if (!linesOnly && this.hold.length) all.union(new THREE.Box3(...this.hold.map((at) => new THREE.Vector3(...at))));
      return all;
    },

    // Keep all of what is shown in sight, unless a user has turned the camera: at once farther away, closer after a while.
    holdAll() {
      const seen = this.seen();
      const size = (box) => box.getSize(new THREE.Vector3()).length();
      if (seen.isEmpty()) return;
      if (!this.held.containsBox(seen)) {
        this.held.union(seen);
        if (this.follows) this.fit(this.held);
      }
      if (size(this.held) > LOOSE * size(seen)) this.closer ??= setTimeout(() => this.comeCloser(), LOOSE_MS);
      else this.stayAway();
    },

    stayAway() {
      clearTimeout(this.closer);
      this.closer = undefined;
    },

    comeCloser() {
      this.stayAway();
      this.held = this.seen();
      if (this.follows) this.fit(this.held);
    },

    // Look from a side, or from where the camera is at the lines alone.
    look(name) {
      if (this.failed) return;
      if (VIEWS[name]) this.camera.position.copy(this.controls.target).add(new THREE.Vector3(...VIEWS[name]));
      const lines = this.seen(true);
      this.follows = name !== "path" || lines.isEmpty();
      this.held = this.seen();
      this.fit(this.follows ? this.held : lines);
      this.remember();
    },

    // Move the camera along its direction until a box fills the picture.
    fit(box) {
      const whole = box.isEmpty() ? new THREE.Box3(new THREE.Vector3(), new THREE.Vector3(1, 1, 1).multiplyScalar(this.span)) : box;
      const middle = whole.getCenter(new THREE.Vector3());
      const away = this.camera.position.clone().sub(this.controls.target).normalize();
      const right = new THREE.Vector3().crossVectors(this.camera.up, away).normalize();
      const upright = new THREE.Vector3().crossVectors(away, right);
      const high = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
      let distance = this.span / 20;
      for (let corner = 0; corner < 8; corner += 1) {
        const at = new THREE.Vector3(...["x", "y", "z"].map((name, i) => (corner & (1 << i) ? whole.max : whole.min)[name]));
        at.sub(middle);
        const across = Math.abs(at.dot(right)) / (high * this.camera.aspect);
        distance = Math.max(distance, MARGIN * Math.max(across, Math.abs(at.dot(upright)) / high) + at.dot(away));
      }
      this.controls.target.copy(middle);
      this.camera.position.copy(middle).addScaledVector(away, distance);
      this.controls.update();
      this.turned();
    },

    // Lines keep their thickness on the screen.
    turned() {
      const thin = this.camera.position.distanceTo(this.controls.target) / LINES_PER_VIEW;
      if (Math.abs(Math.log(thin / this.thin)) > 0.15) {
        for (const tubes of Object.values(this.lines)) tubes.thicken((tubes.radius * thin) / this.thin);
        this.thin = thin;
      }
      this.draw();
    },

    remember() {
      const { follows } = this;
      const places = [this.camera.position.toArray(), this.controls.target.toArray()];
      sessionStorage.setItem(CAMERA_KEY, JSON.stringify({ label: this.label, follows, places }));
    },

    recall() {
      const kept = JSON.parse(sessionStorage.getItem(CAMERA_KEY) ?? "null");
      if (kept?.label !== this.label) return;
      this.follows = kept.follows;
      this.camera.position.fromArray(kept.places[0]);
      this.controls.target.fromArray(kept.places[1]);
      this.controls.update();
      this.turned();
    },

    // Show or hide the joints' axes with their names, or the frames.
    showMarks(name, on) {
      if (this.failed) return;
      this.arms.arm.showMarks(name, on);
      if (name === "axes") for (const joint of this.joints) joint.name.visible = on;
      this.draw();
    },

    // Switch the drawing off and on: without a graphics card it costs a processor.
    enable(on) {
      this.on = on;
      this.hidden = !on;
      this.$el.classList.toggle("off", !on);
      if (on) this.resize();
    },

    // Size of the grid's cells in mm.
    step() {
      return 10 ** Math.round(Math.log10(this.span / 10));
    },

    recolor() {
      this.dark = isDark();
      const style = getComputedStyle(document.body);
      const color = (name) => new THREE.Color(style.getPropertyValue(name).trim());
      for (const tubes of this.tubes) tubes.paint(color(tubes.color));
      for (const part of this.furniture.children) part.material.color = color("--furniture");
      for (const axis of this.axes.children) axis.material.color = color("--muted");
      if (this.grid) {
        this.scene.remove(this.grid);
        this.grid.geometry.dispose();
      }
      const step = this.step();
      const cells = 2 * Math.ceil((0.8 * this.span) / step);
      this.grid = new THREE.GridHelper(cells * step, cells, color("--grid-axis"), color("--grid"));
      this.grid.rotation.x = Math.PI / 2;
      this.grid.position.set(0, 0, 0);
      this.scene.add(this.grid);
      this.draw();
    },

    resize() {
      const { clientWidth: width, clientHeight: height } = this.$el;
      if (!width || !height) return;
      this.renderer.setPixelRatio(this.coarse ? COARSE : Math.min(window.devicePixelRatio, 2));
      this.renderer.setSize(width, height, false);
      this.written.setSize(width, height);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      if (this.follows) this.fit(this.held);
      this.draw();
    },

    // Draw with the next frame, but leave a slow machine more time for the rest than it has needed for drawing: a picture
    // that takes long holds the beats of a jog button up, and the jog ends.
    draw() {
      if (this.waiting || !this.on || this.failed) return;
      this.waiting = true;
      setTimeout(() => requestAnimationFrame(() => this.render()), this.pause ?? 0);
    },

    render() {
      this.waiting = false;
      const began = performance.now();
      this.renderer.render(this.scene, this.camera);
      this.written.render(this.scene, this.camera);
      requestAnimationFrame(() => {
        const took = performance.now() - began;
        const held = document.querySelector(".jog.held") !== null;
        const slow = took > SLOW_MS;
        this.pause = slow ? Math.min((held ? HELD : 2) * took, held ? 1000 : 500) : 0;
        if (held ? slow && !this.coarse : this.coarse) {
          this.coarse = held;
          this.resize();
        }
      });
    },
  },
};
