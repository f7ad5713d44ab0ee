// The page's program: frames are unpacked when they are first wanted, put into 3D textures, and marched through by rays,
// one a pixel, in a fragment shader. One shader draws surfaces (the first point where more is covered than not) and volumes
// (colours added up along the ray). Nothing is fetched.
'use strict';
(() => {
  const $ = (id) => document.getElementById(id);
  const page = JSON.parse($('page').textContent);
  const canvas = $('canvas');

  const fail = (text) => {
    $('fault').textContent = text;
    $('fault').hidden = false;
    document.documentElement.dataset.state = 'failed';
  };
  if (!('DecompressionStream' in window)) return fail('This browser is too old to unpack the pictures: it lacks DecompressionStream.');
  const gl = canvas.getContext('webgl2', { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl) return fail('This browser offers no WebGL2, by which the pictures are drawn.');

  // ---- Unpacking. A frame is three planes of a byte a voxel, each predicted from voxels before it: how much of the voxel is
  // covered, the number of its colour, and its shade.
  const sources = page.series.map((_, s) => $('data' + s).textContent.trim().split('\n'));
  const unpacked = new Map();

  // The number of blocks of four voxels along each axis.
  const blocks = (dimensions) => dimensions.map((n) => (n + 3) >> 2);

  async function unpack(series, frame) {
    const key = series + ':' + frame;
    if (unpacked.has(key)) return unpacked.get(key);
    const text = atob(sources[series][frame]);
    const packed = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    const { dimensions: [w, h, d], palette } = page.series[series];
    const n = w * h * d, layer = w * h;
    const cover = bytes.subarray(0, n), colour = bytes.subarray(n, 2 * n), shade = bytes.subarray(2 * n, 3 * n);
    // Colours times coverage, and shade times coverage, so that between voxels what is empty has no weight.
    const rgba = new Uint8Array(4 * n), shaded = new Uint8Array(n);
    // Which blocks of voxels hold anything, or lie beside what does: rays pass the others in one step.
    const [across, high, deep] = blocks([w, h, d]), held = new Uint8Array(across * high * deep);
    const reds = palette.map((p) => p[0]), greens = palette.map((p) => p[1]), blues = palette.map((p) => p[2]);
    const scale = 255 / page.shades;
    for (let k = 0, i = 0; k < d; k++) {
      for (let j = 0; j < h; j++) {
        for (let x = 0; x < w; x++, i++) {
          let sum = 0, count = 0, left = -1;
          if (k) { left = i - layer; sum += shade[left]; count++; }
          if (j) { left = i - w; sum += shade[left]; count++; }
          if (x) { left = i - 1; sum += shade[left]; count++; }
          if (count) { cover[i] += cover[left]; colour[i] += colour[left]; shade[i] += (sum / count) | 0; }
          const c = cover[i] * 17;
          if (c) {
            const n = colour[i], share = c / 255;
            rgba[4 * i] = reds[n] * share + 0.5; rgba[4 * i + 1] = greens[n] * share + 0.5; rgba[4 * i + 2] = blues[n] * share + 0.5;
            rgba[4 * i + 3] = c;
            for (let z = Math.max(k - 1, 0) >> 2; z <= Math.min(k + 1, d - 1) >> 2; z++)
              for (let y = Math.max(j - 1, 0) >> 2; y <= Math.min(j + 1, h - 1) >> 2; y++)
                for (let b = Math.max(x - 1, 0) >> 2; b <= Math.min(x + 1, w - 1) >> 2; b++) held[b + across * (y + high * z)] = 255;
            shaded[i] = shade[i] * scale * share + 0.5;
          }
        }
      }
    }
    const found = { rgba, shaded, held };
    unpacked.set(key, found);
    // Old frames go where many are large.
    if (unpacked.size * n > 96e6) unpacked.delete(unpacked.keys().next().value);
    return found;
  }

  // ---- Drawing.
  const vertex = `#version 300 es
  void main() { gl_Position = vec4(vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0), 0.0, 1.0); }`;
  const fragment = `#version 300 es
  precision highp float; precision highp sampler3D;
  uniform sampler3D rgbaA, shadeA, heldA, rgbaB, shadeB, heldB;
  uniform vec2 size; uniform float split, distance_, density;
  uniform mat3 turn; uniform vec3 extent, voxels;
  uniform vec3 low, high, corner, side;
  uniform bool octant, volume, comparing, shadesA, shadesB;
  out vec4 colour;
  vec4 tint; float light;
  bool second;
  // The colour and the shade at a point of the unit cube; true where more is covered than not.
  float look(vec3 p) {
    tint = second ? texture(rgbaB, p) : texture(rgbaA, p);
    light = second ? texture(shadeB, p).r : texture(shadeA, p).r;
    return tint.a;
  }
  float covered(vec3 p) { return second ? texture(rgbaB, p).a : texture(rgbaA, p).a; }
  vec3 shown() {
    bool shades = second ? shadesB : shadesA;
    float a = max(tint.a, 1e-3);
    return tint.rgb / a * (shades ? light / a : 1.0);
  }
  bool taken(vec3 p) { return octant && all(greaterThan((p - corner) * side, vec3(0.0))); }
  // From where to where a ray is within a box.
  vec2 within(vec3 o, vec3 d, vec3 a, vec3 b) {
    vec3 s = (a - o) / d, t = (b - o) / d, n = min(s, t), f = max(s, t);
    return vec2(max(max(n.x, n.y), n.z), min(min(f.x, f.y), f.z));
  }
  // Whether a point of the unit cube's surface is near an edge of it.
  bool edge(vec3 p) {
    vec3 inwards = min(p, 1.0 - p) * extent;
    return dot(vec3(lessThan(inwards, vec3(0.005 * distance_ / 4.3))), vec3(1.0)) > 1.5;
  }
  void main() {
    vec2 at = (2.0 * gl_FragCoord.xy - size) / min(size.x, size.y);
    second = comparing && gl_FragCoord.x > split * size.x;
    vec3 o = turn * vec3(0.0, 0.0, distance_) / extent + 0.5;
    vec3 d = turn * normalize(vec3(at * 0.41, -1.0)) / extent;
    d += vec3(lessThan(abs(d), vec3(1e-6))) * 1e-6;
    // Behind all, the edges of the whole image.
    vec2 whole = within(o, d, vec3(0.0), vec3(1.0));
    colour = vec4(vec3(whole.y > max(whole.x, 0.0) && (edge(o + d * whole.x) || edge(o + d * whole.y)) ? 0.83 : 1.0), 1.0);
    vec2 range = within(o, d, low, high);
    range.x = max(range.x, 0.0);
    if (whole.y <= max(whole.x, 0.0)) return;
    if (range.y <= range.x) return;
    float cell = 1.0 / max(max(voxels.x * abs(d.x), voxels.y * abs(d.y)), voxels.z * abs(d.z));
    vec3 sum = vec3(0.0); float left = 1.0;
    float step_ = cell * (volume ? 0.8 : 0.7);
    float t = range.x + (volume ? step_ * fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) : 1e-5);
    bool before = false, fresh = true;
    for (int i = 0; i < 1600; i++) {
      if (t > range.y) break;
      vec3 p = o + d * t;
      if (taken(p)) {
        // On to where the octant ends, whose faces are cut faces.
        vec3 end = mix(vec3(0.0), vec3(1.0), step(0.0, side));
        vec2 inner = within(o, d, min(corner, end), max(corner, end));
        t = max(inner.y, t) + 1e-4 * cell + 1e-6; fresh = true; continue;
      }
      ivec3 block = ivec3(clamp(p, 0.0, 0.9999) * voxels) >> 2;
      if ((second ? texelFetch(heldB, block, 0).r : texelFetch(heldA, block, 0).r) == 0.0) {
        // Nothing is here: on to where the block ends.
        vec3 end = (vec3(block) + step(vec3(0.0), d)) * 4.0 / voxels;
        vec3 there = (end - o) / d;
        t = max(t, min(min(there.x, there.y), there.z)) + 0.02 * cell;
        fresh = false;
        continue;
      }
      if (volume) {
        float a = look(p);
        if (a > 0.0) {
          float opacity = 1.0 - pow(1.0 - density * density * a, step_ / cell);
          sum += left * opacity * shown();
          left *= 1.0 - opacity;
          if (left < 0.01) break;
        }
      } else if (covered(p) > 0.5) {
        if (fresh) {
          // A cut face: flat, with the values inside.
          look(p); colour = vec4(shown(), 1.0); return;
        }
        float a = t - step_, b = t;
        for (int k = 0; k < 6; k++) { float m = 0.5 * (a + b); if (covered(o + d * m) > 0.5) b = m; else a = m; }
        // Just inside, where no white of what is empty is mixed in.
        p = o + d * (b + 0.3 * cell); look(p);
        colour = vec4(shown(), 1.0); return;
      }
      fresh = false;
      t += step_;
    }
    if (volume) colour = vec4(sum + left * colour.rgb, 1.0);
  }`;
  const build = (type, text) => {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  };
  let program;
  try {
    program = gl.createProgram();
    gl.attachShader(program, build(gl.VERTEX_SHADER, vertex));
    gl.attachShader(program, build(gl.FRAGMENT_SHADER, fragment));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  } catch (error) { return fail('The graphics driver refuses the program: ' + error.message); }
  gl.useProgram(program);
  gl.bindVertexArray(gl.createVertexArray());
  const places = new Map();
  const uniform = (name) => { if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name)); return places.get(name); };

  // Three textures a side: what is shown, and what it is compared with.
  const sides = [0, 1].map((side) => ({ holds: '', textures: [0, 1, 2].map((kind) => {
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + 3 * side + kind);
    gl.bindTexture(gl.TEXTURE_3D, texture);
    const filter = kind === 2 ? gl.NEAREST : gl.LINEAR;
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, filter], [gl.TEXTURE_MAG_FILTER, filter],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_3D, key, value);
    return texture;
  }) }));
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  ['rgbaA', 'shadeA', 'heldA', 'rgbaB', 'shadeB', 'heldB'].forEach((name, unit) => gl.uniform1i(uniform(name), unit));

  async function load(side, series, frame) {
    const key = series + ':' + frame;
    if (sides[side].holds === key) return;
    const { rgba, shaded, held } = await unpack(series, frame);
    const size = page.series[series].dimensions;
    [[rgba, gl.RGBA8, gl.RGBA, size], [shaded, gl.R8, gl.RED, size], [held, gl.R8, gl.RED, blocks(size)]].forEach(([bytes, inner, outer, [w, h, d]], kind) => {
      gl.activeTexture(gl.TEXTURE0 + 3 * side + kind);
      gl.bindTexture(gl.TEXTURE_3D, sides[side].textures[kind]);
      gl.texImage3D(gl.TEXTURE_3D, 0, inner, w, h, d, 0, outer, gl.UNSIGNED_BYTE, bytes);
    });
    sides[side].holds = key;
  }

  // ---- What is shown.
  const FIRST = { yaw: 0.55, pitch: 0.4, distance: 4.9 };
  const state = { series: 0, frame: 0, other: -1, occlusion: true, volume: false, cut: 'none', axis: 2, at: [0.5, 0.5, 0.5],
    split: 0.5, density: 0.35, playing: false, ...FIRST };
  const CUTS = ['none', 'octant', 'half', 'slice'];

  const matrix = () => {
    const [sy, cy, sp, cp] = [Math.sin(state.yaw), Math.cos(state.yaw), Math.sin(state.pitch), Math.cos(state.pitch)];
    // Columns: right, up, back.
    return [cy, 0, -sy, -sy * sp, cp, -cy * sp, sy * cp, sp, cy * cp];
  };

  let scale = 1, settled = 0;
  function draw() {
    const series = page.series[state.series];
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * scale;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.max(1, Math.round(n * ratio)));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    const size = series.dimensions.map((n, a) => n * series.spacing[a]);
    const extent = size.map((s) => 2 * s / Math.max(...size));
    const turn = matrix();
    const low = [0, 0, 0], high = [1, 1, 1];
    const a = state.axis, flat = series.dimensions[2] === 1;
    if (state.cut === 'half') {
      // The half before the cut goes, as it is seen.
      if (turn[6 + a] > 0) high[a] = state.at[a]; else low[a] = state.at[a];
    } else if (state.cut === 'slice') {
      const half = 0.5 / series.dimensions[a];
      low[a] = Math.max(0, state.at[a] - half); high[a] = Math.min(1, state.at[a] + half);
    }
    gl.uniform2f(uniform('size'), width, height);
    gl.uniformMatrix3fv(uniform('turn'), false, turn);
    gl.uniform3fv(uniform('extent'), extent);
    gl.uniform3fv(uniform('voxels'), series.dimensions);
    gl.uniform3fv(uniform('low'), low);
    gl.uniform3fv(uniform('high'), high);
    gl.uniform3fv(uniform('corner'), state.at);
    gl.uniform3fv(uniform('side'), [6, 7, 8].map((i) => turn[i] > 0 ? 1 : -1));
    gl.uniform1f(uniform('distance_'), state.distance);
    gl.uniform1f(uniform('density'), state.density);
    gl.uniform1f(uniform('split'), state.split);
    gl.uniform1i(uniform('octant'), state.cut === 'octant' && !flat ? 1 : 0);
    gl.uniform1i(uniform('volume'), state.volume ? 1 : 0);
    gl.uniform1i(uniform('comparing'), state.other !== -1 ? 1 : 0);
    gl.uniform1i(uniform('shadesA'), state.occlusion || !series.separable ? 1 : 0);
    const other = page.series[Math.max(0, state.other)];
    gl.uniform1i(uniform('shadesB'), state.other === -2 ? 0 : state.occlusion || !other.separable ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    axes(turn);
  }

  // The image's axes, as they lie: x right, y up, z over.
  function axes(turn) {
    const small = $('axes'), ratio = window.devicePixelRatio || 1;
    small.width = 84 * ratio; small.height = 84 * ratio;
    const pen = small.getContext('2d');
    pen.scale(ratio, ratio);
    pen.font = '600 13px system-ui, sans-serif'; pen.textAlign = 'center'; pen.textBaseline = 'middle'; pen.lineWidth = 2;
    [['x', '#b3261e'], ['y', '#1e7a34'], ['z', '#1f4fb3']].map(([name, colour], a) => ({ name, colour, x: turn[a], y: turn[3 + a], z: turn[6 + a] }))
      .sort((p, q) => p.z - q.z).forEach(({ name, colour, x, y }) => {
        pen.strokeStyle = pen.fillStyle = colour;
        pen.beginPath(); pen.moveTo(42, 42); pen.lineTo(42 + 26 * x, 42 - 26 * y); pen.stroke();
        pen.fillText(name, 42 + 34 * x, 42 - 34 * y);
      });
  }

  // ---- Controls follow the state, whoever changed it.
  function tell() {
    const series = page.series[state.series];
    $('series').value = state.series; $('other').value = state.other;
    $('turning').hidden = series.frames.length < 2;
    $('frame').max = series.frames.length - 1; $('frame').value = state.frame;
    $('frame-told').textContent = series.frames[state.frame] || '';
    $('play').textContent = state.playing ? 'Stop' : 'Play';
    $('play').setAttribute('aria-pressed', state.playing);
    $('occlusion').checked = state.occlusion;
    $('occlusion').disabled = !series.separable;
    $(state.volume ? 'volume' : 'surface').checked = true;
    $('dense').hidden = !state.volume; $('density').value = state.density;
    $('cut').value = state.cut; $('axis').value = state.axis;
    $('axis-row').hidden = state.cut !== 'half' && state.cut !== 'slice';
    $('places').hidden = state.cut === 'none';
    for (const row of document.querySelectorAll('#places label')) {
      const a = Number(row.dataset.axis);
      row.hidden = state.cut !== 'octant' && a !== state.axis;
      $('at' + a).value = state.at[a];
      const place = series.origin[a] + (state.at[a] * series.dimensions[a] - 0.5) * series.spacing[a];
      $('told' + a).textContent = Math.abs(place) < 1e-6 * series.spacing[a] ? '0' : Number(place.toPrecision(3));
    }
    $('split-row').hidden = state.other === -1; $('split').value = state.split;
    $('edge').hidden = $('left').hidden = $('right').hidden = state.other === -1;
    $('edge').style.left = 100 * state.split + '%';
    $('left').textContent = series.name;
    $('right').textContent = state.other === -2 ? 'without occlusion' : state.other < 0 ? '' : page.series[state.other].name;
    const [w, h, d] = series.dimensions;
    $('told').textContent = `${w} x ${h} x ${d} voxels` + (series.frames.length > 1 ? `, ${series.frames.length} frames` : '') + `; ${page.program}`;
  }

  let busy = false, again = false;
  async function update(moving) {
    if (busy) { again = true; return; }
    busy = true;
    do {
      again = false;
      tell();
      try {
        await load(0, state.series, state.frame);
        if (state.other !== -1) {
          const other = Math.max(state.other === -2 ? state.series : state.other, 0);
          await load(1, other, Math.min(state.frame, page.series[other].frames.length - 1));
        }
      } catch (error) { fail('A picture in this file is damaged: ' + error.message); break; }
      const began = performance.now();
      draw();
      if (moving) { gl.finish(); pace(performance.now() - began); }
    } while (again);
    busy = false;
    clearTimeout(settled);
    if (scale < 1) settled = setTimeout(() => { scale = 1; update(false); }, 220);
    document.documentElement.dataset.state = document.documentElement.dataset.state || 'shown';
  }
  // While something moves, a slow machine draws fewer pixels.
  function pace(milliseconds) {
    if (milliseconds > 60) scale = Math.max(0.25, scale * 0.75); else if (milliseconds < 18) scale = Math.min(1, scale * 1.2);
  }
  const change = (what, moving) => { Object.assign(state, what); update(moving); };
  const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

  page.series.forEach((series, s) => $('series').add(new Option(series.name, s)));
  $('other').add(new Option('nothing', -1));
  if (page.series.some((series) => series.separable)) $('other').add(new Option('itself without occlusion', -2));
  page.series.forEach((series, s) => $('other').add(new Option(series.name, s)));

  const show = (series) => change({ series, frame: Math.min(state.frame, page.series[series].frames.length - 1), axis: page.series[series].dimensions[2] === 1 && state.axis === 2 ? 0 : state.axis });
  $('series').onchange = (e) => show(Number(e.target.value));
  $('other').onchange = (e) => change({ other: Number(e.target.value) });
  $('frame').oninput = (e) => change({ frame: Number(e.target.value), playing: false }, true);
  $('occlusion').onchange = (e) => change({ occlusion: e.target.checked });
  $('surface').onchange = () => change({ volume: false });
  $('volume').onchange = () => change({ volume: true });
  $('density').oninput = (e) => change({ density: Number(e.target.value) }, true);
  $('cut').onchange = (e) => change({ cut: e.target.value });
  $('axis').onchange = (e) => change({ axis: Number(e.target.value) });
  $('split').oninput = (e) => change({ split: Number(e.target.value) }, true);
  [0, 1, 2].forEach((a) => { $('at' + a).oninput = (e) => { state.at[a] = Number(e.target.value); update(true); }; });

  const step = (by) => { const n = page.series[state.series].frames.length; return (state.frame + by + n) % n; };
  let last = 0;
  function tick(now) {
    if (!state.playing) return;
    if (!busy && now - last >= 1000 / page.rate) { last = now; change({ frame: step(1) }, true); }
    requestAnimationFrame(tick);
  }
  const play = () => { change({ playing: !state.playing && page.series[state.series].frames.length > 1 }); requestAnimationFrame(tick); };
  $('play').onclick = play;

  // ---- Pointer, touch and keys.
  const pointers = new Map();
  canvas.onpointerdown = (e) => { canvas.setPointerCapture(e.pointerId); pointers.set(e.pointerId, [e.clientX, e.clientY]); };
  canvas.onpointerup = canvas.onpointercancel = (e) => pointers.delete(e.pointerId);
  canvas.onpointermove = (e) => {
    const before = pointers.get(e.pointerId);
    if (!before) return;
    const apart = () => { const [p, q] = [...pointers.values()]; return Math.hypot(p[0] - q[0], p[1] - q[1]); };
    const [dx, dy] = [e.clientX - before[0], e.clientY - before[1]];
    const old = pointers.size === 2 ? apart() : 0;
    pointers.set(e.pointerId, [e.clientX, e.clientY]);
    if (pointers.size === 1) change({ yaw: state.yaw - dx * 0.008, pitch: clamp(state.pitch + dy * 0.008, -1.55, 1.55) }, true);
    else if (pointers.size === 2 && old > 0) change({ distance: clamp(state.distance * old / Math.max(apart(), 1), 1.2, 12) }, true);
  };
  canvas.addEventListener('wheel', (e) => { e.preventDefault(); change({ distance: clamp(state.distance * Math.exp(e.deltaY * 0.001), 1.2, 12) }, true); }, { passive: false });
  canvas.ondblclick = () => change({ ...FIRST });
  window.addEventListener('keydown', (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const inField = e.target.matches('select, input[type=range]'), button = e.target.matches('button, input');
    const across = (axis) => () => change({ cut: 'slice', axis: page.series[state.series].dimensions[2] === 1 && axis === 2 ? state.axis : axis });
    const move = (by) => () => { for (const a of state.cut === 'octant' ? [0, 1, 2] : [state.axis]) state.at[a] = clamp(state.at[a] + by, 0, 1); update(true); };
    const near = (by) => () => change({ distance: clamp(state.distance * by, 1.2, 12) }, true);
    const around = (yaw, pitch) => () => change({ yaw: state.yaw + yaw, pitch: clamp(state.pitch + pitch, -1.55, 1.55) }, true);
    const does = {
      ArrowLeft: inField ? 0 : () => change({ frame: step(-1), playing: false }, true), ArrowRight: inField ? 0 : () => change({ frame: step(1), playing: false }, true),
      ' ': button ? 0 : play, o: () => change({ occlusion: !state.occlusion }), v: () => change({ volume: !state.volume }),
      c: () => change({ cut: CUTS[(CUTS.indexOf(state.cut) + 1) % CUTS.length] }), x: across(0), y: across(1), z: across(2),
      '[': move(-0.02), ']': move(0.02), '+': near(0.9), '=': near(0.9), '-': near(1 / 0.9),
      a: around(-0.1, 0), d: around(0.1, 0), w: around(0, 0.1), s: around(0, -0.1), r: () => change({ ...FIRST }),
    }[e.key];
    if (does && !(inField && e.key.length === 1 && e.target.matches('select'))) { e.preventDefault(); does(); }
  });
  new ResizeObserver(() => update(false)).observe(canvas);

  // ---- For tests and bookmarks: #frame=3&cut=octant&other=-2 sets the state, #measure=20 times so many frames.
  async function main() {
    const asked = new URLSearchParams(location.hash.slice(1));
    for (const [key, value] of asked) if (key in state && key !== 'at') state[key] = typeof state[key] === 'number' ? Number(value) : typeof state[key] === 'boolean' ? value === 'true' : value;
    if (asked.has('at')) state.at = asked.get('at').split(',').map(Number);
    state.series = clamp(Math.floor(state.series) || 0, 0, page.series.length - 1);
    state.frame = clamp(Math.floor(state.frame) || 0, 0, page.series[state.series].frames.length - 1);
    await update(false);
    const count = Number(asked.get('measure'));
    if (count > 0) {
      const times = { draw: [], frame: [] }, pixel = new Uint8Array(4);
      const timed = async (list, work) => { const began = performance.now(); await work(); gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); list.push(performance.now() - began); };
      for (let i = 0; i < count; i++) {
        state.yaw += 0.05;
        await timed(times.draw, draw);
      }
      for (let i = 0; i < count; i++) {
        state.frame = step(1);
        await timed(times.frame, async () => { await load(0, state.series, state.frame); draw(); });
      }
      const median = (list) => list.sort((a, b) => a - b)[list.length >> 1];
      const measured = document.documentElement.dataset.measured = JSON.stringify({ draw: median(times.draw), frame: median(times.frame), width: canvas.width, height: canvas.height });
      console.info('measured ' + measured);
      tell();
    }
    document.documentElement.dataset.state = document.documentElement.dataset.state === 'failed' ? 'failed' : 'ready';
  }
  main().catch((error) => fail(String(error)));
})();
