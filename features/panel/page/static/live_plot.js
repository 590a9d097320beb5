// A plot that runs: position, rate and following error of every joint over the last seconds. The points stay in the
// browser; the server sends each of them once.
import { echarts } from "nicegui-echart";

const EVERY_MS = 100; // ten pictures a second are as smooth as a plot needs
const QUANTITIES = ["position", "rate", "error"];
const isDark = () => document.body.classList.contains("body--dark");
const PER_SECOND = { position: "", rate: "/s", error: "" };

export default {
  template: '<div class="live-plot" role="img" :aria-label="label"></div>',
  props: { label: String, joints: Array, seconds: Number },

  mounted() {
    this.quantity = "position";
    this.frozen = false;
    this.rows = []; // each t, positions, rates, errors
    this.units = [...new Set(this.joints.map((joint) => joint.unit))];
    this.chart = echarts.init(this.$el, null, { renderer: "canvas" });
    this.restyle();
    this.themes = new MutationObserver(() => this.dark === isDark() || this.restyle());
    this.themes.observe(document.body, { attributeFilter: ["class"] });
    this.sizes = new ResizeObserver(() => this.chart.resize());
    this.sizes.observe(this.$el);
    this.$el.livePlot = this;
    this.timer = setInterval(() => this.redraw(), EVERY_MS);
  },

  beforeUnmount() {
    clearInterval(this.timer);
    this.themes.disconnect();
    this.sizes.disconnect();
    this.chart.dispose();
  },

  methods: {
    add(t, position, rate, error) {
      const last = this.rows.at(-1);
      if (last && t <= last.t) {
        if (t === last.t) return;
        this.rows = []; // the board's clock began again
      }
      this.rows.push({ t, position, rate, error });
      while (this.rows.length && this.rows[0].t < t - this.seconds) this.rows.shift();
      this.stale = true;
    },

    fill(rows) {
      for (const [t, position, rate, error] of rows) this.add(t, position, rate, error);
    },

    show(quantity) {
      this.quantity = quantity;
      this.stale = true;
      this.restyle();
    },

    freeze(on) {
      this.frozen = on;
      this.stale = !on;
    },

    redraw(now = false) {
      if (!now && (!this.stale || this.frozen || document.hidden || !this.$el.clientWidth)) return;
      this.stale = false;
      const end = this.rows.at(-1)?.t ?? 0;
      const series = this.joints.map((_, i) => ({
        data: this.rows.map((row) => [row.t - end, row[this.quantity][i]]),
      }));
      this.chart.setOption({ series });
    },

    restyle() {
      this.dark = isDark();
      const style = getComputedStyle(document.body);
      const color = (name) => style.getPropertyValue(name).trim();
      const text = { color: color("--muted"), fontSize: 12, fontFamily: style.fontFamily };
      const lines = { lineStyle: { color: color("--line") } };
      const unit = (name) => (name === "deg" ? "°" : name) + PER_SECOND[this.quantity];
      this.chart.setOption(
        {
          animation: false,
          color: this.joints.map((_, i) => color(`--series-${i + 1}`)),
          grid: { left: 56, right: this.units.length > 1 ? 56 : 16, top: 42, bottom: 26 },
          legend: { top: 2, left: "center", itemWidth: 16, itemHeight: 3, icon: "rect", textStyle: { ...text, color: color("--ink") } },
          tooltip: {
            trigger: "axis",
            confine: true,
            backgroundColor: color("--card"),
            borderColor: color("--line"),
            textStyle: { ...text, color: color("--ink") },
            valueFormatter: (value) => (value == null ? "–" : value.toFixed(3)),
          },
          xAxis: {
            type: "value",
            min: -this.seconds,
            max: 0,
            axisLabel: { ...text, formatter: (value) => (value ? `${value} s` : "now") },
            axisLine: { ...lines, onZero: false },
            splitLine: { show: false },
          },
          yAxis: this.units.map((name, i) => ({
            type: "value",
            name: unit(name),
            nameTextStyle: text,
            nameGap: 10,
            position: i ? "right" : "left",
            scale: true,
            axisLabel: text,
            axisLine: { onZero: false },
            splitNumber: 4,
            splitLine: i ? { show: false } : lines,
          })),
          series: this.joints.map((joint) => ({
            type: "line",
            name: joint.name,
            showSymbol: false,
            yAxisIndex: this.units.indexOf(joint.unit),
            lineStyle: { width: 2 },
          })),
        },
        { replaceMerge: ["yAxis"] },
      );
      this.redraw(true);
    },
  },
};
