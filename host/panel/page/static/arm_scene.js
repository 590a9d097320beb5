// The 3D view of an arm: polylines as tubes, in mm, z up. Draws only when something has changed, since a machine without
// a graphics card draws with its processor.
import { OrbitControls, THREE } from "nicegui-scene";

const UP = new THREE.Vector3(0, 1, 0); // a cylinder's own axis

// A set of tubes between points, as one instanced mesh of cylinders and one of spheres at the points. A ring: when it is
// full, the newest piece takes the oldest one's place.
class Tubes {
  constructor(radius, { color, opacity = 1, balls = true, capacity = 64 }) {
    const material = new THREE.MeshLambertMaterial({ transparent: opacity < 1, opacity, depthWrite: opacity === 1 });
    this.color = color;
    this.material = material;
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
    for (const mesh of [this.tubes, this.joints]) {
      mesh.frustumCulled = false;
      mesh.count = 0;
      this.group.add(mesh);
    }
    this.clear();
  }

  dispose() {
    for (const mesh of this.group.children.slice()) {
      this.group.remove(mesh);
      mesh.geometry.dispose();
      mesh.dispose();
    }
  }

  clear() {
    this.next = 0;
    this.last = null;
    this.tubes.count = this.joints.count = 0;
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
      this.tubes.instanceMatrix.needsUpdate = true;
    }
    if (this.balls) {
      const ball = new THREE.Matrix4().makeScale(1.25 * this.radius, 1.25 * this.radius, 1.25 * this.radius);
      this.joints.setMatrixAt(this.joints.count, ball.setPosition(end));
      this.joints.count = Math.min(this.joints.count + 1, this.capacity - 1);
      this.joints.instanceMatrix.needsUpdate = true;
    }
    this.last = end;
  }
}

// An arm in pieces: guides thin, slides and links thick, the tool thin and in the colour of its trace.
class Arm {
  constructor(span, color, toolColor, opacity) {
    const piece = (part, tint = color) => new Tubes(span / part, { color: tint, opacity });
    this.pieces = { guide: piece(160, "--guide"), slide: piece(55), link: piece(75), tool: piece(170, toolColor) };
  }

  set(lines, roles) {
    for (const [role, tubes] of Object.entries(this.pieces)) tubes.set(lines.filter((_, i) => roles[i] === role));
  }
}

const SLOW_MS = 40;
const isDark = () => document.body.classList.contains("body--dark");
const VIEWS = { top: [0, -0.001, 1], front: [0, -1, 0.12], side: [1, 0, 0.12], iso: [0.75, -1, 0.7] };

export default {
  template: `
    <div class="arm-scene" role="img" :aria-label="label">
      <canvas></canvas>
      <div class="arm-scene-off" v-if="failed">This browser has no 3D here.</div>
      <div class="arm-scene-off" v-else-if="hidden">The 3D view is switched off.</div>
    </div>`,
  props: { label: String, roles: Array, center: Array, span: Number, boxes: Array },
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
    this.controls.addEventListener("change", () => this.draw());
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.6, -1, 1.8);
    this.scene.add(sun);
    const thin = this.span / 420;
    this.lines = {
      plan: new Tubes(thin, { color: "--plan", balls: false, capacity: 1024 }),
      trace: new Tubes(1.25 * thin, { color: "--trace", balls: false, capacity: 4096 }),
    };
    this.arms = {
      arm: new Arm(this.span, "--arm", "--trace", 1),
      ghost: new Arm(this.span, "--ghost", "--ghost", 0.4),
      other: new Arm(this.span, "--other", "--other", 0.55),
    };
    this.tubes = [...Object.values(this.lines), ...Object.values(this.arms).flatMap((arm) => Object.values(arm.pieces))];
    for (const tubes of this.tubes) this.scene.add(tubes.group);
    this.furniture = new THREE.Group();
    this.scene.add(this.furniture);
    this.setBoxes(this.boxes || []);
    this.recolor();
    this.themes = new MutationObserver(() => this.dark === isDark() || this.recolor());
    this.themes.observe(document.body, { attributeFilter: ["class"] });
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.$el);
    this.look("iso");
    this.$el.armScene = this;
  },

  beforeUnmount() {
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
      this.draw();
    },

    // Lengthen the trace to a point, unless that is less than a pixel or so from its end.
    trace(x, y, z) {
      if (this.failed) return;
      const { last } = this.lines.trace;
      if (last && last.distanceTo(new THREE.Vector3(x, y, z)) < this.span / 1000) return;
      this.lines.trace.add(x, y, z);
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

    look(name) {
      if (this.failed) return;
      const center = new THREE.Vector3(...this.center);
      const away = new THREE.Vector3(...VIEWS[name]).normalize().multiplyScalar(1.05 * this.span);
      this.camera.position.copy(center.clone().add(away));
      this.controls.target.copy(center);
      this.controls.update();
      this.draw();
    },

    // Switch the drawing off and on: without a graphics card it costs a processor.
    enable(on) {
      this.on = on;
      this.hidden = !on;
      this.$el.classList.toggle("off", !on);
      if (on) this.resize();
    },

    recolor() {
      this.dark = isDark();
      const style = getComputedStyle(document.body);
      const color = (name) => new THREE.Color(style.getPropertyValue(name).trim());
      for (const tubes of this.tubes) tubes.material.color = color(tubes.color);
      for (const part of this.furniture.children) part.material.color = color("--furniture");
      if (this.grid) {
        this.scene.remove(this.grid);
        this.grid.geometry.dispose();
      }
      const step = 10 ** Math.round(Math.log10(this.span / 10));
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
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.fov = width < height ? 35 * (height / width) ** 0.7 : 35; // all of it in an upright window, too
      this.camera.updateProjectionMatrix();
      this.draw();
    },

    // Draw with the next frame, but leave a slow machine as much time for the rest as it has needed for drawing.
    draw() {
      if (this.waiting || !this.on || this.failed) return;
      this.waiting = true;
      setTimeout(() => requestAnimationFrame(() => this.render()), this.pause ?? 0);
    },

    render() {
      this.waiting = false;
      const began = performance.now();
      this.renderer.render(this.scene, this.camera);
      requestAnimationFrame(() => {
        const took = performance.now() - began;
        this.pause = took > SLOW_MS ? Math.min(2 * took, 500) : 0;
      });
    },
  },
};
