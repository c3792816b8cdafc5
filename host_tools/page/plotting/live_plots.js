// Where scripts run, plots that can be zoomed take the place of a page's pictures over time: torque, residual, velocity and
// position of a joint, one above the other, with one cursor and one time axis. On paper the pictures stay.
(() => {
  'use strict';
  const root = document.documentElement;
  const colour = (name) => () => getComputedStyle(root).getPropertyValue(name).trim();
  const digits = (value) => (value === undefined || value === null ? '-' : Number(value.toPrecision(4)).toString());
  const wheelOfZoom = 2, arrow = 1 / 200, fewestSamples = 5;

  /// Columns of a figure: unsigned numbers of 16 bits, little end first, each column between its two ends.
  function columnsOf(figure) {
    const bytes = Uint8Array.from(atob(figure.dataset.live), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const ends = figure.dataset.ends.split(' ').map(Number);
    const count = bytes.length / ends.length;
    return Array.from({length: ends.length / 2}, (_, c) => Array.from({length: count},
      (__, k) => ends[2 * c] + (ends[2 * c + 1] - ends[2 * c]) * view.getUint16(2 * (c * count + k), true) / 65535));
  }

  function panelsOf(figure) {
    const [t, measured, residual, velocity, position] = columnsOf(figure);
    const predicted = measured.map((value, k) => value - residual[k]);
    const [torque, path] = figure.dataset.units.split(' ');
    const curve = (name, data, paint) => ({name, data, paint});
    return {t, all: [
      {label: 'torque', unit: torque, height: 220, curves: [curve('measured', measured, '--measured'), curve('predicted', predicted, '--predicted')]},
      {label: 'residual', unit: torque, height: 130, curves: [curve('residual', residual, '--residual')]},
      {label: 'velocity', unit: `${path}/s`, height: 110, curves: [curve('velocity', velocity, '--quiet')]},
      {label: 'position', unit: path, height: 140, curves: [curve('position', position, '--quiet')]}]};
  }

  function axes(panel, last, time) {
    const usual = {stroke: colour('--text'), font: '12px system-ui, sans-serif', labelFont: '12px system-ui, sans-serif', labelSize: 18,
      grid: {stroke: colour('--line'), width: 1}, ticks: {stroke: colour('--line'), width: 1, size: 4}};
    return [{...usual, size: last ? 32 : 8, label: last ? time : undefined, values: last ? undefined : (_, ticks) => ticks.map(() => '')},
      {...usual, size: 56, label: `${panel.label} [${panel.unit}]`}];
  }

  function element(name, text, parent) {
    const made = document.createElement(name);
    made.textContent = text;
    parent.append(made);
    return made;
  }

  class LivePlot {
    constructor(figure) {
      this.figure = figure;
      this.panels = panelsOf(figure);
      this.box = document.createElement('div');
      this.box.className = 'live-plot';
      this.box.tabIndex = 0;
      this.box.setAttribute('role', 'group');
      this.box.setAttribute('aria-label', `${figure.querySelector('figcaption').textContent}; arrows move the cursor, + and - zoom, 0 shows all`);
      this.box.addEventListener('keydown', (event) => this.key(event));
      this.tools();
      figure.append(this.box);
      figure.classList.add('on');
      const key = `plot ${made.size}`;
      this.plots = this.panels.all.map((panel, i) => this.plot(panel, i + 1 === this.panels.all.length, key));
      this.say(null);
      new ResizeObserver(() => this.fit()).observe(figure);
    }

    tools() {
      const tools = element('p', '', this.box);
      tools.className = 'tools';
      for (const [text, action] of [['zoom in', () => this.zoom(1 / wheelOfZoom)], ['zoom out', () => this.zoom(wheelOfZoom)], ['all', () => this.show()]]) {
        const button = element('button', text, tools);
        button.type = 'button';
        button.addEventListener('click', action);
      }
      this.readout = element('span', '', tools);
    }

    plot(panel, last, key) {
      const options = {width: this.width(), height: panel.height, legend: {show: false}, padding: [6, 8, 0, 0],
        scales: {x: {time: false}}, axes: axes(panel, last, this.figure.dataset.time),
        series: [{}, ...panel.curves.map((one) => ({label: one.name, stroke: colour(one.paint), width: 1.4, points: {show: false}}))],
        cursor: {y: false, points: {size: 7}, drag: {x: true, y: false},
          sync: {key, setSeries: false, filters: {pub: (type) => type === 'mousemove' || type === 'mouseleave'}}},
        hooks: {setCursor: [(u) => this.say(u.cursor.idx)], setScale: [(u, scale) => scale === 'x' && this.follow(u)]}};
      return new uPlot(options, [this.panels.t, ...panel.curves.map((one) => one.data)], this.box);
    }

    width() { return Math.max(200, Math.floor(this.figure.clientWidth)); }

    fit() {
      if (this.figure.clientWidth > 0 && this.width() !== this.plots[0].width)
        this.plots.forEach((u, i) => u.setSize({width: this.width(), height: this.panels.all[i].height}));
    }

    /// All panels show the time that one of them does.
    follow(from) {
      if (this.following || !this.plots) return;
      this.following = true;
      const {min, max} = from.scales.x;
      for (const u of this.plots) if (u !== from) u.setScale('x', {min, max});
      this.following = false;
    }

    show(min = this.panels.t[0], max = this.panels.t.at(-1)) {
      const least = fewestSamples * (this.panels.t.at(-1) - this.panels.t[0]) / this.panels.t.length;
      if (max - min >= least) this.plots[0].setScale('x', {min: Math.max(min, this.panels.t[0]), max: Math.min(max, this.panels.t.at(-1))});
    }

    zoom(factor) {
      const {min, max} = this.plots[0].scales.x, {idx} = this.plots[0].cursor;
      const about = idx === null || idx === undefined ? (min + max) / 2 : this.panels.t[idx];
      this.show(about - (about - min) * factor, about + (max - about) * factor);
    }

    key(event) {
      const [u] = this.plots, {min, max} = u.scales.x, step = (max - min) * arrow;
      const actions = {'+': () => this.zoom(1 / wheelOfZoom), '-': () => this.zoom(wheelOfZoom), '0': () => this.show(),
        ArrowLeft: () => this.move(-step), ArrowRight: () => this.move(step)};
      if (event.ctrlKey || event.metaKey || event.altKey || !actions[event.key]) return;
      event.preventDefault();
      actions[event.key]();
    }

    /// The cursor by so many seconds, from the middle where there is none.
    move(seconds) {
      const [u] = this.plots, {min, max} = u.scales.x;
      const from = this.at === undefined || this.at < min || this.at > max ? (min + max) / 2 : this.at;
      const to = Math.min(max, Math.max(min, from + seconds));
      for (const one of this.plots) one.setCursor({left: one.valToPos(to, 'x'), top: 1});
      this.at = to;
    }

    /// What the curves are at the cursor, and what they are called.
    say(index) {
      const known = index !== null && index !== undefined;
      this.at = known ? this.panels.t[index] : this.at;
      this.readout.replaceChildren();
      element('span', known ? `${digits(this.panels.t[index])} s` : 'drag to zoom, double click shows all', this.readout);
      for (const panel of this.panels.all) {
        for (const one of panel.curves) {
          const value = element('span', `${one.name}${known ? ` ${digits(one.data[index])} ${panel.unit}` : ''}`, this.readout);
          const mark = document.createElement('i');
          mark.style.background = `var(${one.paint})`;
          value.prepend(mark);
        }
      }
    }
  }

  const made = new Set();
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting || made.has(entry.target)) continue;
      seen.unobserve(entry.target);
      made.add(entry.target);
      const live = new LivePlot(entry.target);
      entry.target.live = live;  // for scripts of others
      matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => live.plots.forEach((u) => u.redraw(false, true)));
    }
  }, {rootMargin: '400px'});
  for (const figure of document.querySelectorAll('figure.live')) seen.observe(figure);
})();
