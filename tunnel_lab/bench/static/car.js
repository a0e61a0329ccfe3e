// The model from above: it swings by the trace in real time, unless less motion is wanted.
export default {
  template: `<figure class="car">
    <svg viewBox="-60 -36 120 72" role="img" aria-label="The model from above">
      <path d="M-58 0 H-42 M-48 -4 L-42 0 L-48 4" class="wind"/>
      <g ref="car"><rect x="-32" y="-11" width="64" height="22" rx="7" class="body"/>
      <path d="M-14 -8 h12 v16 h-12 q-5 -8 0 -16" class="glass"/></g><circle r="2.5" class="rod"/>
    </svg>
    <figcaption class="soft"><button type="button" @click="turn">{{ running ? "Hold" : "Release" }}</button>
      {{ now.toFixed(1) }} s</figcaption></figure>`,
  props: { time: { type: Array, default: () => [] }, angle: { type: Array, default: () => [] } },
  data: () => ({ running: false, now: 0 }),
  mounted() { if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.turn(); },
  beforeUnmount() { this.running = false; },
  methods: {
    turn() {
      this.running = !this.running;
      this.now = 0;
      this.begun = performance.now();
      if (this.running) requestAnimationFrame(() => this.frame());
    },
    frame() {
      if (!this.running) return;
      const end = this.time[this.time.length - 1] || 1;
      this.now = ((performance.now() - this.begun) / 1000) % (end + 1);
      const step = (this.time[1] || 1) - (this.time[0] || 0);
      const at = this.angle[Math.min(Math.round(this.now / step), this.angle.length - 1)] || 0;
      this.$refs.car.setAttribute("transform", `rotate(${(at * 180) / Math.PI})`);
      requestAnimationFrame(() => this.frame());
    },
  },
};
