// A chart by uPlot with marks: handles above it that are dragged, moved with the arrow keys, or removed with Delete.
export default {
  template: `<figure><figcaption class="soft">{{ title }}</figcaption><div class="plot" ref="plot" role="img" :aria-label="title"></div>
    <button v-if="adds" type="button" class="button" :aria-label="'Add a release to ' + title" @click="add">Add a release</button></figure>`,
  props: { title: String, x: String, y: String, series: Array, data: Array, marks: Array, focus: String, adds: Boolean },
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
    marks: { handler() { this.place(); }, deep: true },
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
      const axis = (label, size) => ({
        label, labelSize: 18, size, font: "11px system-ui", labelFont: "12px system-ui", stroke: this.colour("ink"),
        grid: { stroke: this.colour("line"), width: 1 }, ticks: { stroke: this.colour("line"), size: 5 },
      });
      this.chart = new uPlot({
        width, height: this.height(width),
        scales: { x: { time: false } },
        axes: [axis(this.x, 34), axis(this.y, 56)],
        series: [{}, ...this.series.map(([label, role]) => ({
          label, stroke: this.colour(role), width: 1.3, points: { show: false },
        }))],
        legend: { show: this.series.length > 1, live: false },
        hooks: { setScale: [() => requestAnimationFrame(() => this.place())] },
      }, this.data, this.$refs.plot);
      this.handles = new Map();
      this.place();
    },
    add() {
      const { min, max } = this.chart.scales.x;
      this.$emit("added", { at: 0.5 * (min + max) });
    },
    height(width) { return Math.max(180, Math.min(300, Math.round(0.32 * width))); },
    place() {
      if (!this.chart || !this.handles) return;
      const wanted = new Set(this.marks.map((mark) => mark.id));
      for (const [id, handle] of this.handles) if (!wanted.has(id)) { handle.remove(); this.handles.delete(id); }
      for (const mark of this.marks) {
        const handle = this.handles.get(mark.id) || this.handle(mark.id);
        handle.className = `mark ${mark.kind}${mark.out ? " out" : ""}`;
        handle.setAttribute("aria-label", mark.label);
        handle.setAttribute("aria-valuenow", mark.at);
        const said = `${mark.at.toPrecision(5)} ${mark.unit}`, { clientWidth, clientHeight } = this.chart.over;
        handle.setAttribute("aria-valuetext", said);
        handle.title = `${mark.label}: ${said}`;
        const rest = mark.kind === "rest";
        const at = this.chart.valToPos(mark.at, rest ? "y" : "x");
        handle.style[rest ? "top" : "left"] = `${at}px`;
        handle.hidden = at < -1 || at > (rest ? clientHeight : clientWidth) + 1;
        if (!rest) continue;
        const [from, to] = [mark.from, mark.to].map((x) => Math.min(Math.max(this.chart.valToPos(x, "x"), 0), clientWidth));
        handle.style.left = `${from}px`;
        handle.style.width = `${to - from}px`;
        handle.hidden ||= to <= from;
        handle.firstChild.textContent = mark.about;
        handle.firstChild.style.top = `${-at - 9}px`; // above the chart, where no trace is
      }
      const sought = this.handles.get(this.focus);
      if (sought && !sought.hidden && this.sought !== this.focus) { // once: later changes leave the focus where it is
        this.sought = this.focus;
        sought.focus();
      }
    },
    handle(id) {
      const made = this.chart.over.appendChild(document.createElement("div"));
      made.appendChild(document.createElement("span"));
      made.tabIndex = 0;
      made.setAttribute("role", "slider");
      const mark = () => this.marks.find((one) => one.id === id);
      const [axis, values] = mark().kind === "rest" ? ["y", this.data[1].filter((v) => v != null)] : ["x", this.data[0]];
      const least = Math.min(...values), most = Math.max(...values);
      made.setAttribute("aria-orientation", axis === "y" ? "vertical" : "horizontal");
      made.setAttribute("aria-valuemin", least);
      made.setAttribute("aria-valuemax", most);
      const to = (at) => {
        mark().at = Math.min(Math.max(at, least), most);
        mark().about = `${mark().label}: ${mark().at.toPrecision(4)} ${mark().unit}`;
        this.place();
      };
      const report = () => this.$emit("moved", { id, at: mark().at });
      let pending;
      made.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        event.stopPropagation();
        made.focus();
        made.setPointerCapture(event.pointerId);
        const box = this.chart.over.getBoundingClientRect(), before = mark().at;
        made.onpointermove = (move) =>
          to(this.chart.posToVal(axis === "y" ? move.clientY - box.top : move.clientX - box.left, axis));
        made.onpointerup = () => {
          made.onpointermove = made.onpointerup = null;
          if (mark().at !== before) report(); // a click states nothing
        };
      });
      made.addEventListener("mousedown", (event) => event.stopPropagation()); // uPlot would zoom
      made.addEventListener("keydown", (event) => {
        if (event.key === "Delete" && mark().kind === "start") {
          event.preventDefault();
          this.$emit("removed", { id });
        }
        const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
        if (!steps) return;
        event.preventDefault();
        const { min, max } = this.chart.scales[axis], { clientWidth, clientHeight } = this.chart.over;
        to(mark().at + steps * (max - min) / (axis === "y" ? clientHeight : clientWidth));
        clearTimeout(pending);
        pending = setTimeout(report, 600);
      });
      this.handles.set(id, made);
      return made;
    },
  },
};
