"use strict";
// The panel: play, seek, follow. `viewer` is Meshcat's; its scene has z upwards, its camera y.
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const play = document.getElementById("replay-play");
  const slider = document.getElementById("replay-time");
  const now = document.getElementById("replay-now");
  const follow = document.getElementById("replay-follow");
  if (viewer === undefined) {
    now.textContent = "This browser shows no three-dimensional graphics (WebGL).";
    return;
  }
  const animator = viewer.animator;
  const pane = viewer.dom_element;
  const robot = viewer.scene_tree.find(data.robot).object;
  const whole = { position: null, target: null, shape: 0 };  // the view to come back to
  let last = null;  // where the robot was, while it is followed

  const shape = () => pane.offsetWidth / pane.offsetHeight;
  const upright = ([x, y, z]) => [x, z, -y];  // in the camera's coordinates

  function place() {
    return upright(robot.position.toArray());
  }

  function remember() {
    whole.position = viewer.camera.position.clone();
    whole.target = viewer.controls.target.clone();
  }

  // The first view: that of the widest window which this one holds.
  function fit() {
    const aspect = shape();
    const view = data.views.findLast((known) => known.aspect <= aspect) ?? data.views[0];
    viewer.camera.position.set(...upright(view.eye));
    viewer.controls.target.set(...upright(view.target));
    whole.shape = aspect;
    remember();
  }

  // As long as nobody has moved the camera it fits the window again.
  function resized() {
    const { position } = viewer.camera;
    const untouched = last === null && position.distanceTo(whole.position) < 1e-6 * position.length();
    viewer.set_3d_pane_size();
    if (untouched) fit(); else whole.shape = shape();
  }

  function shift(by) {
    for (const point of [viewer.camera.position, viewer.controls.target]) {
      point.set(point.x + by[0], point.y + by[1], point.z + by[2]);
    }
  }

  play.addEventListener("click", () => {
    if (animator.playing) animator.pause(); else animator.play();
  });
  function show(t) {
    animator.pause();
    animator.seek(t);
    animator.display_progress(t);
  }
  slider.addEventListener("input", () => show(Number(slider.value)));
  follow.addEventListener("click", () => {
    const target = viewer.controls.target;
    if (last === null) {
      remember();
      last = place();
      shift([last[0] - target.x, last[1] - target.y, last[2] - target.z]);
      const offset = viewer.camera.position.clone().sub(target);
      viewer.camera.position.copy(offset.setLength(data.near).add(target));
    } else {
      last = null;
      viewer.camera.position.copy(whole.position);
      target.copy(whole.target);
    }
    follow.textContent = last === null ? "Follow the robot" : "Whole world";
    follow.setAttribute("aria-pressed", String(last !== null));
    viewer.set_dirty();
  });

  function tick() {
    const t = Math.min(animator.time, data.duration);
    play.textContent = animator.playing ? "Pause" : "Play";
    if (document.activeElement !== slider || animator.playing) slider.value = String(t);
    const row = Math.min(Math.round(t * data.rate), data.speed.length - 1);
    const mode = data.words[data.mode[row]];
    const at = `(${robot.position.x.toFixed(2)}, ${robot.position.y.toFixed(2)}) m`;
    const words = [`${t.toFixed(1)} s`, `${data.speed[row].toFixed(2)} m/s`, at];
    now.textContent = (mode ? [...words, mode] : words).join(" \u00b7 ");
    if (shape() !== whole.shape) resized();
    if (last !== null) {
      const here = place();
      shift([here[0] - last[0], here[1] - last[1], here[2] - last[2]]);
      last = here;
      viewer.set_dirty();
    }
    requestAnimationFrame(tick);
  }

  // replay.html#t=5.6 stands at that instant, replay.html#t=5.6&follow close to the robot.
  function address() {
    const asked = new URLSearchParams(window.location.hash.slice(1));
    const t = Number.parseFloat(asked.get("t"));
    if (Number.isFinite(t)) show(Math.min(Math.max(t, 0), data.duration));
    if (asked.has("follow") && last === null) follow.click();
  }

  viewer.renderer.toneMapping = MeshCat.THREE.NoToneMapping;  // colours as given
  fit();
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) show(0);
  address();
  window.addEventListener("hashchange", address);
  requestAnimationFrame(tick);
})();
