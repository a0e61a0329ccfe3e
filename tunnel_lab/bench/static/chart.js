// A chart by uPlot with marks: handles above it that are dragged, or moved with the arrow keys.
export default {
  template: `<figure><figcaption class="soft">{{ title }}</figcaption><div class="plot" ref="plot" role="img" :aria-label="title"></div></figure>`,
  props: { title: String, x: String, y: String, series: Array, data: Array, marks: Array, levels: Array },
  mounted() {
    this.resize = new ResizeObserver(() => this.build());
    this.resize.observe(this.$el);
    this.theme = new MutationObserver(() => this.build(true));
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
  },
  beforeUnmount() {
    this.resize.disconnect();
    this.theme.disconnect();
    this.chart?.destroy();
  },
  watch: {
    data() { this.chart ? this.chart.setData(this.data) : this.build(); },
    marks: { handler() { this.chart?.redraw(false); this.place(); }, deep: true },
    levels() { this.chart?.redraw(false); },
  },
  methods: {
    colour(role) { return getComputedStyle(this.$el).getPropertyValue(`--${role}-now`).trim() || this.probe(role); },
    probe(role) {
      const one = this.$el.appendChild(document.createElement("span"));
      one.style.color = `var(--${role})`;
      const found = getComputedStyle(one).color;
      one.remove();
      return found;
    },
    build(again = false) {
      const width = this.$refs.plot.clientWidth;
      if (!width || typeof uPlot === "undefined") return;
      if (this.chart && !again) {
        this.chart.setSize({ width, height: this.height(width) });
        return this.place();
      }
      this.chart?.destroy();
      const number = (value) => (value == null ? "–" : String(Number(value.toPrecision(4))).replace("-", "−"));
      const axis = (label, size) => ({
        label, labelSize: 18, size, font: "11px system-ui", labelFont: "12px system-ui", stroke: this.colour("ink"),
        grid: { stroke: this.colour("line"), width: 1 }, ticks: { stroke: this.colour("line"), size: 5 },
      });
      this.chart = new uPlot({
        width, height: this.height(width),
        scales: { x: { time: false } },
        axes: [axis(this.x, 34), axis(this.y, 56)],
        series: [{ label: this.x, value: (_, v) => number(v) }, ...this.series.map(([label, role]) => ({
          label, stroke: this.colour(role), width: 1.3, points: { show: false }, value: (_, v) => number(v),
        }))],
        legend: { show: this.series.length > 1 },
        hooks: { draw: [(chart) => this.paint(chart)], setScale: [() => requestAnimationFrame(() => this.place())] },
      }, this.data, this.$refs.plot);
      this.handles = new Map();
      this.place();
    },
    height(width) { return Math.max(180, Math.min(300, Math.round(0.32 * width))); },
    paint(chart) {
      const pen = chart.ctx, { left, top, width, height } = chart.bbox;
      pen.save();
      pen.beginPath();
      pen.rect(left, top, width, height);
      pen.clip();
      pen.strokeStyle = this.colour("accent");
      pen.lineWidth = 2 * devicePixelRatio;
      pen.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
      for (const level of this.levels) {
        const y = chart.valToPos(level.at, "y", true);
        pen.beginPath();
        pen.moveTo(chart.valToPos(level.from, "x", true), y);
        pen.lineTo(chart.valToPos(level.to, "x", true), y);
        pen.stroke();
      }
      pen.restore();
    },
    place() {
      if (!this.chart || !this.handles) return;
      const wanted = new Set(this.marks.map((mark) => mark.id));
      for (const [id, handle] of this.handles) if (!wanted.has(id)) { handle.remove(); this.handles.delete(id); }
      for (const mark of this.marks) {
        const handle = this.handles.get(mark.id) || this.handle(mark.id);
        handle.className = `mark ${mark.kind}`;
        handle.setAttribute("aria-label", mark.label);
        handle.setAttribute("aria-valuenow", mark.at);
        handle.setAttribute("aria-valuetext", `${mark.at.toPrecision(5)} s`);
        handle.title = `${mark.label}: ${mark.at.toPrecision(5)} s`;
        const at = this.chart.valToPos(mark.at, "x");
        handle.style.left = `${at}px`;
        handle.hidden = at < -1 || at > this.chart.over.clientWidth + 1;
      }
    },
    handle(id) {
      const made = this.chart.over.appendChild(document.createElement("div"));
      made.tabIndex = 0;
      made.setAttribute("role", "slider");
      const last = this.data[0][this.data[0].length - 1];
      made.setAttribute("aria-valuemin", this.data[0][0]);
      made.setAttribute("aria-valuemax", last);
      const mark = () => this.marks.find((one) => one.id === id);
      const to = (at) => { mark().at = Math.min(Math.max(at, this.data[0][0]), last); this.place(); };
      const report = () => this.$emit("moved", { id, at: mark().at });
      made.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        event.stopPropagation();
        made.focus();
        made.setPointerCapture(event.pointerId);
        const box = this.chart.over.getBoundingClientRect();
        made.onpointermove = (move) => to(this.chart.posToVal(move.clientX - box.left, "x"));
        made.onpointerup = () => { made.onpointermove = made.onpointerup = null; report(); };
      });
      made.addEventListener("mousedown", (event) => event.stopPropagation()); // uPlot would zoom
      made.addEventListener("keydown", (event) => {
        const steps = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10 }[event.key];
        if (!steps) return;
        event.preventDefault();
        const { min, max } = this.chart.scales.x;
        to(mark().at + steps * (max - min) / this.chart.over.clientWidth);
        clearTimeout(this.pending);
        this.pending = setTimeout(report, 600);
      });
      this.handles.set(id, made);
      return made;
    },
  },
};
