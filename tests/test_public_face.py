import vsp


def test_a_distilled_policy_earns_most_of_what_its_teacher_does():
    teacher = vsp.load_teacher("SimpleGoal-v0")
    policy, _ = vsp.distill(teacher, "SimpleGoal-v0", seed=0)
    target, mean = (vsp.evaluate(actor, "SimpleGoal-v0", 1000, seed=1)["return"].mean() for actor in (teacher, policy))
    assert target - 5 < mean < target + 1  # standing still earns 0
