"use strict";
// The panel: play, seek, follow. `viewer` is Meshcat's; its scene has z upwards, its camera y.
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const play = document.getElementById("replay-play");
  const slider = document.getElementById("replay-time");
  const now = document.getElementById("replay-now");
  const follow = document.getElementById("replay-follow");
  const animator = viewer.animator;
  const robot = viewer.scene_tree.find(data.robot).object;
  const whole = { position: null, target: null };
  let last = null;  // where the robot was, while it is followed

  function place() {
    const p = robot.position;
    return [p.x, p.z, -p.y];
  }

  function remember() {
    whole.position = viewer.camera.position.clone();
    whole.target = viewer.controls.target.clone();
  }

  // The first view holds the whole world in a window of this shape; a narrower one needs more distance.
  function fit() {
    const narrow = Math.max(1, data.aspect * window.innerHeight / window.innerWidth);
    const target = viewer.controls.target;
    viewer.camera.position.sub(target).multiplyScalar(narrow).add(target);
    remember();
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
  address();
  window.addEventListener("hashchange", address);
  requestAnimationFrame(tick);
})();
