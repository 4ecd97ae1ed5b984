// Plays `recording` (see film_of in replay.py) in Meshcat's scene. For scripts that take pictures:
//   film.duration               s
//   film.play(), film.pause()
//   film.show(time)             stops at a time in s
//   film.camera({follow, from, times})
//                               follows the robot, or stands and sees it at all `times`;
//                               `from`: direction in World from the robot to the camera
//   film.still(times)           the last instant, the earlier ones faded, with path and distance
//   film.dress(on)              shows or hides heading, legend, bar (none at rest) and names
window.addEventListener("load", () => {
  const {BoxGeometry, BufferGeometry, Color, ConeGeometry, CylinderGeometry, Fog, Group} = MeshCat.THREE;
  const {Line, LineBasicMaterial, Mesh, MeshPhongMaterial, Quaternion, Raycaster, Vector3} = MeshCat.THREE;
  const {bodies, cables, colours, contacts, nodes, progress, strut, times} = recording;
  const UP = new Vector3(0, 0, 1);
  const WIDTH_FILLED = 0.7, HEIGHT_FILLED = 0.58;  // shares of the picture
  const LARGE = 0.1;  // radius of a sphere that the camera heeds, as a share of the robot's size
  const AFAR = 30;  // robots
  const SMOOTHING = 0.6;  // s before and after a time over which the camera's target is averaged
  const duration = times.at(-1) - times[0];
  const element = (id) => document.getElementById(id);
  const find = (...path) => viewer.scene_tree.find(path).object;

  const mesh = (object) => object.isMesh ? object : object.children.map(mesh).find((found) => found);

  // Browsers without graphics hardware draw a large triangle wrongly if the camera is above it.
  const slab = mesh(find("floor", "slab"));
  if (slab) {
    const {width, height, depth} = slab.geometry.parameters;
    slab.geometry = new BoxGeometry(width, height, depth, 16, 16);
  }

  function sums(rows) {
    return rows.map((steps) => {
      let sum = 0;
      return steps.map((step) => recording.resolution * (sum += step));
    });
  }
  const poses = sums(recording.poses), radii = sums(recording.radii);
  const touches = sums(recording.touches), arrows = sums(recording.arrows);
  const traces = sums(recording.traces);

  // Numbers of the recording at the moment.
  let time = 0, frame = 0, share = 0;
  function seek(seconds) {
    time = Math.min(Math.max(seconds, 0), duration);
    const last = times.length - 1;
    frame = Math.min(Math.round(time / duration * last), last - 1);
    while (frame > 0 && times[frame] - times[0] > time) frame -= 1;
    while (frame < last - 1 && times[frame + 1] - times[0] <= time) frame += 1;
    share = (time + times[0] - times[frame]) / (times[frame + 1] - times[frame]);
  }
  const now = (row) => row[frame] + share * (row[frame + 1] - row[frame]);
  const vector = (rows, first) => new Vector3(...rows.slice(first, first + 3).map(now));

  // Where bodies and nodes are.
  function pose(body) {
    const [w, x, y, z] = poses.slice(7 * body + 3, 7 * body + 7).map(now);
    return {position: vector(poses, 7 * body), turn: new Quaternion(x, y, z, w).normalize()};
  }
  function node_places() {
    const placed = bodies.map((_, body) => pose(body));
    return nodes.map(({body, place}) => {
      const point = new Vector3(...place);  // of a fixed node, whose body is -1, in World
      return body < 0 ? point : point.applyQuaternion(placed[body].turn).add(placed[body].position);
    });
  }
  const mean = (points) =>
    points.reduce((sum, point) => sum.add(point), new Vector3()).divideScalar(points.length);

  // The objects of the scene.
  const body_objects = bodies.map((name) => find("robot", ...name.split("/")));
  const cable_objects = cables.map(({path}) => find(...path));
  const feet = contacts.map((node) => mesh(find(...nodes[node].path)));
  const force_arrows = contacts.map(() => arrow(colours.force));
  const paths = traces.filter((_, row) => row % 3 == 0).map((_, path) => line(3 * path));
  viewer.scene.fog = new Fog(colours.sky);

  // An arrow 1 m long along z, with a head of length `tip`.
  function arrow(colour, tip = 0.25) {
    const material = new MeshPhongMaterial({color: colour}), group = new Group();
    const shaft = new Mesh(new CylinderGeometry(0.5, 0.5, 1 - tip), material);
    const head = new Mesh(new ConeGeometry(1.5, tip), material);
    for (const [part, z] of [[shaft, 0.5 - tip / 2], [head, 1 - tip / 2]]) {
      part.rotation.x = Math.PI / 2;
      part.position.z = z;
      group.add(part);
    }
    viewer.scene.add(group);
    return group;
  }
  function point_arrow(object, start, reach) {
    const length = Math.max(reach.length(), 1e-6), width = Math.min(strut, length / 4);
    object.position.copy(start);
    object.scale.set(width, width, length);
    object.quaternion.setFromUnitVectors(UP, reach.clone().normalize());
  }
  function line(row) {
    const points = times.map((_, i) => new Vector3(...traces.slice(row, row + 3).map((r) => r[i])));
    const drawn = new Line(
      new BufferGeometry().setFromPoints(points), new LineBasicMaterial({color: colours.trace}));
    drawn.frustumCulled = false;
    viewer.scene.add(drawn);
    return drawn;
  }

  // Moves everything to where it is at a time.
  let places = [];
  function place(seconds) {
    seek(seconds);
    places = node_places();
    body_objects.forEach((object, body) => {
      const {position, turn} = pose(body);
      object.position.copy(position);
      object.quaternion.copy(turn);
    });
    cable_objects.forEach((object, cable) => {
      const [start, end] = cables[cable].nodes.map((node) => places[node]);
      const along = end.clone().sub(start), radius = now(radii[cable]);
      object.position.copy(start).add(end).divideScalar(2);
      object.scale.set(radius, radius, along.length());
      object.quaternion.setFromUnitVectors(UP, along.normalize());
    });
    contacts.forEach((node, contact) => {
      const stands = touches[contact][frame] > 0;
      feet[contact].material.color.set(stands ? colours.stance : nodes[node].colour);
      find(...nodes[node].path).scale.setScalar(stands ? 1.5 : 1);
      point_arrow(force_arrows[contact], places[node], vector(arrows, 3 * contact));
      force_arrows[contact].visible = element("forces").checked;
    });
    for (const path of paths) path.geometry.setDrawRange(0, frame + 1);
  }

  // What the camera follows: the robot's middle, without its sway.
  const middles = times.map((_, i) => {
    seek(times[i] - times[0]);
    return mean(node_places());
  });
  const steady = middles.map((_, i) =>
    mean(middles.filter((_, j) => Math.abs(times[j] - times[i]) <= SMOOTHING)));
  const middle = () => steady[frame].clone().lerp(steady[frame + 1], share);

  // Camera and light. Meshcat's camera has its y axis up, so World is turned for it.
  const seen = (point) => point.clone().applyMatrix4(viewer.scene.matrixWorld);
  const sun = find("Lights", "FillLight", "<object>"), to_sun = sun.position.clone();
  viewer.scene.add(sun.target);
  viewer.scene.updateMatrixWorld();
  place(0);
  const size = Math.max(...places.map((point) => point.distanceTo(mean(places))));
  let followed = null;  // the target of a camera that follows
  function aim(target) {
    const {camera, controls} = viewer, goal = seen(target);
    const shift = goal.clone().sub(followed ?? controls.target);
    camera.position.add(shift);
    controls.target.add(shift);
    followed = goal;
  }
  function light(target) {
    sun.target.position.copy(target);
    sun.position.copy(target).add(to_sun);
  }
  // Moves the camera so that points fill the picture, whatever its direction.
  function fit(points) {
    const {camera, controls} = viewer;
    // From afar, as a point behind the camera has no place in the picture.
    const afar = camera.position.clone().sub(controls.target).setLength(AFAR * size);
    camera.position.copy(controls.target).add(afar);
    for (let round = 0; round < 8; round += 1) {
      controls.update();
      camera.updateMatrixWorld();
      const shown = points.map((point) => seen(point).project(camera));
      const low = shown.reduce((a, b) => a.clone().min(b));
      const high = shown.reduce((a, b) => a.clone().max(b));
      const centre = low.clone().add(high).divideScalar(2);
      centre.z = controls.target.clone().project(camera).z;
      const shift = centre.unproject(camera).sub(controls.target);
      const half = high.sub(low).divideScalar(2);
      const farther = Math.max(half.x / WIDTH_FILLED, half.y / HEIGHT_FILLED);
      camera.position.sub(controls.target).multiplyScalar(farther).add(controls.target).add(shift);
      controls.target.add(shift);
    }
    const distance = camera.position.distanceTo(controls.target);
    Object.assign(viewer.scene.fog, {near: distance, far: 2.6 * distance});
  }
  // Points around the nodes; a large sphere counts with its ends along the axes.
  const ends = [-1, 1].flatMap((sign) => [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) =>
    new Vector3(...axis).multiplyScalar(sign)));
  function around(seconds) {
    seek(seconds);
    return node_places().flatMap((point, node) => {
      const {radius} = nodes[node];
      if (radius < LARGE * size) return [point];
      return ends.map((end) => point.clone().addScaledVector(end, radius));
    });
  }
  let standing = null;  // times at which a standing camera sees the robot
  function frame_picture() {
    // In a window too low for a picture; no camera fits, and none would come back from infinity.
    if (viewer.dom_element.offsetHeight <= 0) return;
    const back = time;
    viewer.camera.updateProjectionMatrix();
    if (standing) {
      fit(standing.flatMap(around));
    } else {
      const target = middle();
      const moments = Array.from({length: 16}, (_, i) => i * duration / 15);
      fit(moments.flatMap((moment) =>
        around(moment).map((point) => point.sub(middle()).add(target))));
    }
    place(back);
    show_frame();
  }

  // Names over the bodies, and a ruler on the floor.
  const labels = [];
  function label(text, point, kind) {
    const span = document.createElement("span");
    span.textContent = text;
    span.className = kind;
    element("labels").append(span);
    labels.push({span, point});
  }
  if (recording.named) {
    bodies.forEach((name, body) => {
      const own = nodes.map((node, i) => i).filter((i) => nodes[i].body == body);
      label(name, () => {
        const top = own.map((i) => places[i]).reduce((a, b) => a.z > b.z ? a : b).clone();
        return top.setZ(top.z + 5 * strut);
      }, "name");
    });
  }
  const {length, dark} = recording;
  const gap = dark * Math.ceil(size / (2.5 * dark));  // between two marks of the ruler, in m
  const heights = new Map();
  function height(x, y) {
    const key = `${x} ${y}`;
    if (!heights.has(key)) {
      const ray = new Raycaster(seen(new Vector3(x, y, 10)), new Vector3(0, -1, 0));
      const hits = ray.intersectObjects([find("floor")], true).filter((hit) => hit.face);
      heights.set(key, hits.length ? 10 - hits[0].distance : NaN);
    }
    return heights.get(key);
  }
  for (let mark = -2; mark <= 2; mark += 1) {
    const along = () => gap * (Math.round(middle().x / gap) + mark);
    const point = () => {
      const y = dark * Math.floor((middle().y - 0.5 * size) / dark);
      const x = along();
      return new Vector3(x, y, height(x, y));
    };
    label("", point, "ruler");
    labels.at(-1).text = () => `${Number((along() / length.size).toPrecision(6))} ${length.name}`;
  }
  function show_labels() {
    const {offsetWidth, offsetHeight} = viewer.dom_element;
    viewer.camera.updateMatrixWorld();
    for (const {span, point, text} of labels) {
      const {x, y, z} = seen(point()).project(viewer.camera);
      const hidden = !(z < 1 && Math.abs(x) < 1 && Math.abs(y) < 1);
      span.style.display = hidden ? "none" : "";
      if (text) span.textContent = text();
      const [left, top] = [(x + 1) / 2 * offsetWidth, (1 - y) / 2 * offsetHeight];
      span.style.transform = `translate(${left}px, ${top}px) translate(-50%, -50%)`;
    }
  }

  // The bar.
  const shown = (value) => `${value.toFixed(progress.digits)}${progress.unit}`;
  function show_frame() {
    light(middle());
    if (element("follow").checked) aim(middle());
    element("time").value = time;
    element("time").setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    element("clock").value = `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
    element("reached").value = `${progress.what} ${shown(now(progress.values))}`;
    viewer.set_dirty();
  }
  let playing = false;
  function set_playing(on) {
    playing = on;
    element("play").textContent = on ? "❚❚" : "▶";
    element("play").setAttribute("aria-pressed", on);
  }
  function show(seconds) {
    set_playing(false);
    place(seconds);
    show_frame();
    show_labels();
  }
  function follow(on) {
    element("follow").checked = on;
    followed = null;
    if (!on) return;
    standing = null;
    aim(middle());
    frame_picture();
  }
  element("time").max = duration;
  element("time").addEventListener("input", (event) => show(Number(event.target.value)));
  element("play").addEventListener("click", () => set_playing(!playing));
  element("follow").addEventListener("change", (event) => follow(event.target.checked));
  element("forces").addEventListener("change", () => { place(time); viewer.set_dirty(); });
  element("legend").open = window.innerWidth > 900;
  const ARROWS = {ArrowLeft: -0.1, ArrowRight: 0.1};  // s
  window.addEventListener("keydown", (event) => {
    const {code, shiftKey, target} = event;
    const plays = code == "Space" && [document.body, element("time")].includes(target);
    const moves = code in ARROWS && !target.matches("select");  // which has arrows of its own
    if (plays) set_playing(!playing);
    if (moves) show(time + ARROWS[code] * (shiftKey ? 10 : 1));
    if (plays || moves) event.preventDefault();  // the report around this page would scroll
  });
  for (const id of ["legend", "text"]) element(id)?.addEventListener("toggle", arrange);
  window.addEventListener("resize", arrange);

  let before = performance.now();
  function tick(instant) {
    const passed = (instant - before) / 1000 * Number(element("speed").value);
    before = instant;
    if (playing) {
      place(time >= duration ? 0 : time + passed);
      show_frame();
    }
    show_labels();
    requestAnimationFrame(tick);
  }

  function camera({follow: on = false, from = null, times: standing_times = null}) {
    if (from) {
      const {camera, controls} = viewer;
      const distance = camera.position.distanceTo(controls.target);
      camera.position.copy(seen(new Vector3(...from)).setLength(distance)).add(controls.target);
    }
    standing = on ? null : standing_times;
    follow(on);
    if (standing) {
      const points = standing.flatMap(around);
      const low = points.reduce((a, b) => a.clone().min(b));
      const high = points.reduce((a, b) => a.clone().max(b));
      aim(low.add(high).divideScalar(2));
    }
    frame_picture();
  }

  // A copy of the robot as it is, faded.
  function add_ghost(fading) {
    for (const original of [find("robot"), find("cables")]) {
      const ghost = original.clone();
      ghost.traverse((part) => {
        if (!part.isMesh) return;
        part.material = part.material.clone();
        part.material.color.lerp(new Color(colours.floor), fading);
        part.castShadow = false;
      });
      viewer.scene.add(ghost);
    }
  }
  // The moments at which the robot is half its size apart, and the first and the last.
  function moments_apart(moments) {
    const at = moments.map((moment) => mean(around(moment))), last = moments.length - 1;
    let before = at[0];
    return moments.filter((_, i) => {
      if (i == 0 || i == last) return true;
      if (Math.min(at[i].distanceTo(before), at[i].distanceTo(at[last])) < 0.5 * size) return false;
      before = at[i];
      return true;
    });
  }
  function still(instants) {
    dress(false);
    labels.splice(0).forEach(({span}) => span.remove());
    element("labels").hidden = false;
    const walked = progress.what != "turned";  // else the instants lie one above the other
    const moments = walked ? moments_apart(instants) : instants;
    camera({times: moments, from: [0.35, -1, 0.4]});
    moments.forEach((moment, i) => {
      show(moment);
      const above = mean(places), last = i == moments.length - 1;
      above.z = Math.max(...places.map((point) => point.z)) + 12 * strut;
      if (walked) label(`${moment} s`, () => above, "name");
      if (!last) add_ghost(0.65 - 0.2 * i / moments.length);
    });
    const start = paths[0].geometry.attributes.position;
    const from = new Vector3().fromBufferAttribute(start, 0);
    const way = new Vector3(now(traces[0]) - from.x, 0, now(traces[2]) - from.z);
    from.y = Math.min(...places.map((point) => point.y)) - 24 * strut;
    if (walked) point_arrow(arrow(colours.trace, 0.04), from, way);
    const half = from.clone().addScaledVector(way, 0.5).setY(from.y - 16 * strut);
    label(shown(now(progress.values)), () => half, "name");
    show_labels();
  }
  function dress(on) {
    for (const id of ["heading", "legend", "labels"]) element(id).hidden = !on;
    const bar = on && !recording.rests;
    element("bar").hidden = !bar;
    document.documentElement.style.setProperty("--bar", bar ? null : "0px");
    arrange();
  }
  // On a narrow screen, heading and legend have room of their own, so that they hide nothing.
  function arrange() {
    const narrow = window.matchMedia("(max-width: 700px)").matches;
    for (const id of ["heading", "legend"]) {
      const height = narrow ? element(id).offsetHeight : 0;
      document.documentElement.style.setProperty(`--${id}`, `${height}px`);
    }
    viewer.set_3d_pane_size();
    frame_picture();
  }

  viewer.renderer.domElement.setAttribute("role", "img");
  viewer.renderer.domElement.setAttribute("aria-label", document.title);
  viewer.set_3d_pane_size();
  aim(middle());
  dress(true);
  set_playing(!recording.rests);
  requestAnimationFrame(tick);
  const play = () => set_playing(true), pause = () => set_playing(false);
  window.film = {duration, play, pause, show, camera, still, dress};
});
